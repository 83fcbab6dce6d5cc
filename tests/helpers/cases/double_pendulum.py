"""A double pendulum whose upper arm hangs from a driven clamp."""

import anctmm as at

STEEL = at.Material(E=2e8, density=1500.0)
upper = at.Beam("upper", (0.0, 0.0), (0.4, 0.0), at.Rectangle(0.02, 0.008), STEEL)
lower = at.Beam("lower", (0.4, 0.0), (0.4, -0.3), at.Rectangle(0.02, 0.006), STEEL)
scene = at.Scene(
    "double-pendulum",
    [upper, lower],
    [at.Clamp("upper.start", angle=at.Quintic(turn=0.6, duration=0.3)), at.Pin("upper.end", "lower.start")],
    gravity=(0.0, -9.81),
)
CASES = [
    at.Case(scene, ["lower.end", ("upper", 0.5)], t_end=0.4, output_dt=0.02, note="A soft arm is turned.")
]
