"""A chain of three beams, thrown into the air with a spin; nothing holds it."""

import anctmm as at

RUBBER = at.Material(E=5e6, density=1100.0)


def link(k):
    start, end = (0.2 * k, 0.0), (0.2 * (k + 1), 0.0)
    velocity = at.RigidVelocity(start, end, center=(0.3, 0.0), spin=4.0, velocity=(1.0, 3.0))
    return at.Beam(f"link{k}", start, end, at.Circle(0.012), RUBBER, velocity)


scene = at.Scene(
    "thrown-chain",
    [link(k) for k in range(3)],
    [at.Pin("link0.end", "link1.start"), at.Pin("link1.end", "link2.start")],
    gravity=(0.0, -9.81),
)
CASES = [at.Case(scene, ["link0.start", "link2.end"], t_end=0.3, output_dt=0.01)]
