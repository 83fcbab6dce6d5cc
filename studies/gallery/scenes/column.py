"""Column: a slender column under its load and a small push aside; beyond Euler's force it bends far."""

from math import asin, atan2, degrees, hypot, pi, sin

from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

import anctmm as at

steel, section = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.03, 0.003)
EULER = pi**2 * steel.E * section.second_moment / 4  # N, of a column of 1 m, clamped below and free above


def column(push, load=1.1):
    """The column with both forces in parts of Euler's."""
    beam = at.Beam("column", (0, 0), (0, 1), section, steel)
    force = at.Force("column.end", (push * EULER, -load * EULER))
    return at.Scene("column", [beam], [at.Clamp("column.start")], [force])


CASES = [at.Case(column(push=0.05), ["column.end", ("column", 0.5)], t_end=None)]
RUN = {"mesh": 32, "path": "arclength"}


def known(s):
    """Elastica whose load leans by α, and its tip by φ from the load: K(k) − F(α, k) = √(F L²/EI)."""
    lean, force = atan2(0.05, 1.1), hypot(0.05, 1.1) * pi**2 / 4

    def excess(turn):
        k = sin(turn / 2)
        return ellipk(k**2) - ellipkinc(asin(sin(lean / 2) / k), k**2) - force**0.5

    exact = degrees(brentq(excess, 1.0001 * lean, 3.1) - lean)
    turn = -degrees(s.angle("column.end")[-1])
    return "turn of the tip", turn, exact, 1e-2, "°", "Euler's elastica, by elliptic integrals"


def curves(s):
    return "turn of the tip (rad)", -s.angle("column.end"), "load / Euler's force", {"push of 5 %": 1.1 * s.t}
