"""Snap-through: two bars lean on each other and carry a load, until they snap through and hang below."""

from math import hypot

import anctmm as at

SPAN, RISE, LOAD = 1.0, 0.1, 8e3  # m (half of it), m, N
wood, section = at.Material(E=1e10, density=600.0), at.Rectangle(0.02, 0.1)
bars = [
    at.Beam("left", (-SPAN, 0), (0, RISE), section, wood),
    at.Beam("right", (0, RISE), (SPAN, 0), section, wood),
]
hinges = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
scene = at.Scene("snap-through", bars, hinges, [at.Force("left.end", (0, -LOAD))])
CASES = [at.Case(scene, ["left.end"], t_end=None)]
RUN = {"mesh": 1, "path": "arclength"}


def known(s):
    whole = hypot(SPAN, RISE)
    y = ((SPAN**2 * whole) ** (2 / 3) - SPAN**2) ** 0.5  # height at the largest load
    exact = 2 * wood.E * section.area * y * (1 / hypot(SPAN, y) - 1 / whole)
    first = LOAD * s.t[: s.t.argmin()].max()
    return "load at which they snap", first, exact, 1e-6 * exact, "N", "largest of 2 EA y (1/l − 1/l₀)"
