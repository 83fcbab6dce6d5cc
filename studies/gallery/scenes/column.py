"""A slender column under its load and a small push aside: beyond Euler's force it bends far."""

from math import pi

import anctmm as at

steel, section = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.03, 0.003)
EULER = pi**2 * steel.E * section.second_moment / 4  # N, of a column of 1 m, clamped below and free above


def column(push, load=1.1):
    """The column with both forces in parts of Euler's."""
    beam = at.Beam("column", (0, 0), (0, 1), section, steel)
    force = at.Force("column.end", (push * EULER, -load * EULER))
    return at.Scene("column", [beam], [at.Clamp("column.start")], [force])


CASES = [at.Case(column(push=0.05), ["column.end", ("column", 0.5)], t_end=None)]
