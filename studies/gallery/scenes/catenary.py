"""A rope of 100 m over a span of 80 m: two straight halves are let sag until they are at rest."""

import anctmm as at

fibre, round_ = at.Material(E=5e8, density=1100.0), at.Circle(0.02)
left = at.Beam("left", (0, 0), (40, -30), round_, fibre)
right = at.Beam("right", (40, -30), (80, 0), round_, fibre)
hinges = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
scene = at.Scene("catenary", [left, right], hinges, gravity=(0, -9.81))
CASES = [at.Case(scene, ["left.end", ("left", 0.5)], t_end=None)]
