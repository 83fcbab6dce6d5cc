"""Integrators and their parameters.

A method is data: the steps themselves stand in `anctmm.integrators`.
"""

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class GeneralizedAlpha:
    """Coefficients of the method.

    Parameters
    ----------
    spectral_radius : float
        ρ∞ in [0, 1]: 1 keeps the energy of high frequencies, 0 annihilates them in one step.
    """

    spectral_radius: float

    @property
    def alpha_m(self) -> float:
        """Weight of the old acceleration a."""
        return (2.0 * self.spectral_radius - 1.0) / (self.spectral_radius + 1.0)

    @property
    def alpha_f(self) -> float:
        """Weight of the old w."""
        return self.spectral_radius / (self.spectral_radius + 1.0)

    @property
    def gamma(self) -> float:
        """Newmark's γ, for second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """Newmark's β, for the most dissipation of high frequencies at the least of low ones."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def of_step(self, h: float) -> "Coefficients":
        """Coefficients of a step of h (s)."""
        am, af, b, g = self.alpha_m, self.alpha_f, self.beta, self.gamma
        return Coefficients(h, am, af, b, g, (1 - am) / (b * h * h * (1 - af)))


class Coefficients(NamedTuple):
    """Step h (s), αm, αf, β, γ, and what a correction of q adds to w."""

    h: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    to_w: float
