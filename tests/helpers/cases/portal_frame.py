"""A portal frame of two clamped columns and a beam, pushed aside, and the same at rest under its load."""

import anctmm as at

STEEL = at.Material(E=5e8, density=3000.0, poisson=0.3)
column, girder = at.Rectangle(0.03, 0.02), at.Rectangle(0.03, 0.025)
bodies = [
    at.Beam("left", (0.0, 0.0), (0.0, 1.0), column, STEEL),
    at.Beam("girder", (0.0, 1.0), (1.5, 1.0), girder, STEEL),
    at.Beam("right", (1.5, 1.0), (1.5, 0.0), column, STEEL),
]
joints = [
    at.Clamp("left.start"),
    at.Weld("left.end", "girder.start"),
    at.Weld("girder.end", "right.start"),
    at.Clamp("right.end"),
]


class Push:
    """A sideways force that grows and ends, as a class without data: nothing of it may be kept between sessions."""

    def __call__(self, t):
        pulse = at.Pulse(amplitude=20.0, duration=0.2)
        return pulse(t), 0.0 * pulse(t)


pushed = at.Scene("portal-frame", bodies, joints, [at.Force("left.end", Push())])
loaded = at.Scene("portal-frame-at-rest", bodies, joints, [at.Force("girder.start", (5.0, -20.0))])
CASES = [
    at.Case(pushed, ["girder.start", ("girder", 0.5)], t_end=0.3, output_dt=0.01),
    at.Case(loaded, ["girder.start"], t_end=None, note="Half of what buckles it."),
]
