"""Integrators and their parameters.

A method is data only: the steps are in `anctmm.integrators`.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError
from anctmm.validation import number, within


@dataclass(frozen=True)
class Zhai:
    """Zhai's explicit two-step method (Rong 2014, eq. 38).

    Parameters
    ----------
    psi, phi : float
        ψ and φ; with ½ and ½ the positions are those of Störmer–Verlet.

    Raises
    ------
    DiscretisationError
        If one is no finite number.
    """

    psi: float = 0.5
    phi: float = 0.5
    name: ClassVar[str] = "zhai"
    explicit: ClassVar[bool] = True
    order: ClassVar[float] = 2.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "psi", number("psi", self.psi, DiscretisationError))
        object.__setattr__(self, "phi", number("phi", self.phi, DiscretisationError))


@dataclass(frozen=True)
class GeneralizedAlpha:
    """Generalized-α (Chung & Hulbert 1993), implicit, in the form of Arnold & Brüls (2007).

    Parameters
    ----------
    spectral_radius : float
        ρ∞ in [0, 1]: 1 conserves the energy of high frequencies, 0 removes them in one step. With rigid bodies, guides
        and driven hinges use 0.9 or less: closer to 1, errors of the constraint forces remain in the steps or grow;
        they grow, too, where a body turns by more than about 0.7 (1 − ρ∞) rad in a step.
        Accelerations at outputs, and therefore reactions, are free of them.

    Raises
    ------
    DiscretisationError
        If it lies outside.
    """

    spectral_radius: float = 0.9
    name: ClassVar[str] = "generalized-alpha"
    explicit: ClassVar[bool] = False
    order: ClassVar[float] = 2.0

    def __post_init__(self) -> None:
        radius = within("spectral_radius", self.spectral_radius, 0.0, 1.0, "[]", DiscretisationError)
        object.__setattr__(self, "spectral_radius", radius)

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
        return Coefficients(h, am, af, b, g, (1 - am) / (b * h * h * (1 - af)), 1.0, 0.0)


class Coefficients(NamedTuple):
    """Step h (s), αm, αf, β, γ, and what a correction x adds: to_w x to w, to_q x to q.

    Newton's matrix is to_w M + to_q K_T. `level` is the time derivative of the constraints that Newton's iteration
    enforces: 0 (positions) or 2 (accelerations).
    """

    h: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    to_w: float
    to_q: float
    level: float


@dataclass(frozen=True)
class Esdirk:
    """A Runge-Kutta method of fourth order with five implicit stages, for small errors.

    ESDIRK4(3)6L[2]SA of Kennedy & Carpenter (2003, doi:10.1016/S0168-9274(02)00138-1, table of the implicit part):
    L-stable, all stages with one matrix; the first is the end of the last step. See
    `anctmm.integrators.esdirk`. It has no parameters.
    """

    name: ClassVar[str] = "esdirk"
    explicit: ClassVar[bool] = False
    order: ClassVar[float] = 4.0


class Stages(NamedTuple):
    """Runge-Kutta coefficients: matrix A, its square, and nodes c; the last row of A is the weights.

    A: for velocities, A²: for positions, (stages, stages); c: (stages,).
    """

    A: NDArray[np.float64]
    square: NDArray[np.float64]
    c: NDArray[np.float64]


_STAGES = (
    (),
    ("1/4",),
    ("8611/62500", "-1743/31250"),
    ("5012029/34652500", "-654441/2922500", "174375/388108"),
    ("15267082809/155376265600", "-71443401/120774400", "730878875/902184768", "2285395/8070912"),
    ("82889/524892", "0", "15625/83664", "69875/102672", "-2260/8211"),
)


@cache
def stages() -> Stages:
    """Coefficients of `Esdirk`, computed once: read-only."""
    A = np.zeros((len(_STAGES), len(_STAGES)))
    for i, row in enumerate(_STAGES):
        A[i, :i] = [float(Fraction(x)) for x in row]
        A[i, i] = 0.25 if row else 0.0
    return Stages(A, A @ A, np.array([0.0, 1 / 2, 83 / 250, 31 / 50, 17 / 20, 1.0]))


#: Weights b̂ of third order embedded in `Esdirk` (same source).
_EMBEDDED = (
    "4586570599/29645900160", "0", "178811875/945068544", "814220225/1159782912", "-3700637/11593932", "61727/225920"
)  # fmt: skip


def error_weights() -> NDArray[np.float64]:
    """Weights b − b̂ of accelerations of stages, for errors of positions over h² and velocities over h, (2, stages)."""
    A = stages().A
    less = A[-1] - np.array([float(Fraction(b)) for b in _EMBEDDED])
    return np.stack([less @ A, less])


Method = Zhai | GeneralizedAlpha | Esdirk
#: Methods by name, as a discretisation names them. A new one is a class here, and a case in `anctmm.solve`.
METHODS: dict[str, type[Method]] = {m.name: m for m in (Zhai, GeneralizedAlpha, Esdirk)}
