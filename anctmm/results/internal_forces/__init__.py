"""Internal forces of a scene: loads on bodies, reactions of joints, section forces."""
