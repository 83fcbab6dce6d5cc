"""Catenary: a rope of 100 m over a span of 80 m, drawn as a V, is let sag until it is at rest."""

import anctmm as at
from reference.exact import Catenary

fibre, round_ = at.Material(E=5e8, density=1100.0), at.Circle(0.02)
left = at.Beam("left", (0, 0), (40, -30), round_, fibre)
right = at.Beam("right", (40, -30), (80, 0), round_, fibre)
hinges = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
scene = at.Scene("catenary", [left, right], hinges, gravity=(0, -9.81))
CASES = [at.Case(scene, ["left.end", ("left", 0.5)], t_end=None)]
RUN = {"mesh": 16}


def known(s):
    weight, stiffness = 9.81 * fibre.density * round_.area, fibre.E * round_.area
    exact = Catenary((80.0, 0.0), 100.0, weight, stiffness).position(0.5)[1]
    source = "extensible catenary, Irvine 1981, section 2.3"
    return "lowest point, y", s.position("left.end")[-1, 1], exact, 2e-3, "m", source
