"""Initial velocities: of rigid motions, and whether joints and drives can have them."""
