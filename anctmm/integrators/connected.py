"""Stiffness and damping of the connectors of a scene, for its stability limit."""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.maps import push
from anctmm.forces.actuation import Actuation
from anctmm.forces.connectors import add_connectors, measure, slopes
from anctmm.forces.stiffness import tangent_of
from anctmm.jit.compiling import uncompiled
from anctmm.recursion.riccati import mass_factors, solve

Array = NDArray[np.float64]


class Connected:
    """Connectors of a scene as they are at t = 0.

    Parameters
    ----------
    chain : Chain
    """

    def __init__(self, chain: Chain) -> None:
        self.chain, self.connectors, self.values = chain, None, np.empty((0, 2))
        if chain.parts.connectors:
            actuation = Actuation(chain.parts, chain.bodies)
            self.connectors = actuation.loads().connectors
            self.values = actuation.load_table(np.zeros(1))[0]

    def subtract(self, q: Array, at: Array, damping: bool, out: Array) -> None:
        """Subtract from `out`, (rows, nodes), the forces at coordinates `at`, or at q and the velocities at − q."""
        if self.connectors is None:
            return
        force, rest = np.zeros_like(q), np.zeros_like(q)
        place, v = (q, at - q) if damping else (at, rest)
        add_connectors(self.connectors, place, v, self.values, force)
        out -= force

    @property
    def damped(self) -> bool:
        """Whether any connector resists velocities."""
        c = self.connectors
        return c is not None and any(self._slopes(n)[1] != 0.0 for n in range(len(c.kinds)))

    def bounds(self) -> tuple[float, float]:
        """What connectors add to the square of the highest frequency, 1/s², and to the highest rate, 1/s, at most.

        The sums of k g M⁻¹ g of each, g the generalized force of a unit of its own: bounds of the largest eigenvalue.
        """
        c = self.connectors
        if c is None:
            return 0.0, 0.0
        factors, q = mass_factors(self.chain), self.chain.bodies.reference()
        stiff = rates = 0.0
        for n in range(len(c.kinds)):
            ax, ay, bx, by, _, _, across = uncompiled(tangent_of)(c, n, q, 1.0, self.values)
            k, d = self._slopes(n)
            for along, rate, one, two in (
                (abs(k), abs(d), (ax, ay), (bx, by)),
                (abs(across), 0.0, (ay, -ax), (by, -bx)),
            ):
                force = np.zeros_like(q)
                uncompiled(push)(c.first, n, *one, force)
                uncompiled(push)(c.second, n, *two, force)
                softness = float((force * solve(factors, force.copy())).sum()) if along or rate else 0.0
                softness = max(softness, 0.0)  # of what is held, rounding
                stiff, rates = stiff + along * softness, rates + rate * softness
        return stiff, rates

    def _slopes(self, n: int) -> tuple[float, float]:
        c = self.connectors
        assert c is not None  # called for one of them
        free = self.values[c.driven[n]] if c.driven[n] >= 0 else (c.numbers[n, 3], 0.0)
        m = uncompiled(measure)(c, n, self.chain.bodies.reference())[0]
        k, d = uncompiled(slopes)(c, n, m - free[0], -free[1], 0.0)
        return float(k), float(d)
