"""Two bars lean on each other and carry a load, until they snap through and hang below."""

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
