"""Stability limit of the explicit integrator, from the highest frequency of the linearised scene."""

from math import inf, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies, elastic_forces, mass_product
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.joined import Joined
from anctmm.discretise.mesh import BodyMesh
from anctmm.errors import StabilityError
from anctmm.integrators.connected import Connected
from anctmm.recursion.riccati import mass_factors, solve

Array = NDArray[np.float64]

#: Step of the central difference of the elastic force; the force is a smooth function of gradients of size 1.
DIFFERENCE = 1e-6
#: Coordinates up to which a scene with constraints is linearised as a dense matrix.
DENSE = 400
#: Accelerations by springs, of those without joints, below which joints keep the places of springs where they are.
HELD = 1e-9


def zhai_limit(psi: float, phi: float) -> float:
    """Largest stable Δt·ω_max of undamped motion: √(2/ψ) for ψ = φ ≥ ½; 0 for all others, which the solver refuses.

    Some of those have smaller limits, and none a larger one than ½, ½: see anctmm/recursion/method.md, section 3.
    """
    return sqrt(2.0 / psi) if psi == phi and psi >= 0.5 else 0.0


def step_limit(psi: float, phi: float, frequency: float, rate: float = 0.0) -> float:
    """Largest stable step of a mode q̈ + c q̇ + ω² q = 0, s: the h with ½ψ ω²h² + (½ + φ) c h = 1, where q turns sign.

    Parameters
    ----------
    psi, phi : float
        Equal and at least ½.
    frequency, rate : float
        ω, rad/s, and c, 1/s; c = τω² with Kelvin-Voigt damping.
    """
    a, b = 0.5 * psi * frequency**2, (0.5 + phi) * rate
    return 2.0 / (b + sqrt(b * b + 4.0 * a)) if a > 0.0 or b > 0.0 else inf


def highest_frequency(
    chain: Chain, q: Array | None = None, bodies: Bodies | None = None, *, damping: bool = False
) -> float:
    """Largest angular frequency ω_max of a scene linearised about a configuration, rad/s.

    Lanczos on M⁻¹K_T; the product with M⁻¹ is the Riccati sweep, that with K_T a difference of elastic forces, so
    that here, too, no global matrix is assembled.

    Parameters
    ----------
    chain : Chain
    q : ndarray, shape (rows, nodes), optional
        The undeformed scene without it.
    bodies : Bodies, optional
        Others than the chain's, of the same nodes, to take the elastic forces from.
    damping : bool
        Whether the forces of connectors are those of velocities.

    Returns
    -------
    float
        0 where nothing can move.
    """
    bodies = bodies or chain.bodies
    small = _Linearised(chain, bodies.reference() if q is None else q, bodies, damping)
    n = small.join.size
    if n == 0 or not (chain.scene.connectors or any(mesh.elements for mesh in bodies.meshes)):
        return 0.0
    constrained = chain.plan.kept and chain.kept.constraints.names
    if n < 3 or (constrained and n <= DENSE):  # few freedoms beside the coordinates may stop Lanczos early
        return _by_dense_matrices(small)
    return _by_lanczos(small)


class _Linearised:
    """Products with stiffness, mass and inverse mass of a scene linearised about a configuration."""

    def __init__(self, chain: Chain, q: Array, bodies: Bodies, damping: bool) -> None:
        self.q, self.bodies, self.damping, self.length = q, bodies, damping, chain.length
        self.inverse = mass_factors(chain, q)
        self.join, self.connected = Joined(chain), Connected(chain)
        self.buffer, self.up, self.down = bodies.buffer(), np.empty_like(q), np.empty_like(q)

    def _force(self, at: Array, out: Array) -> None:
        bodies = self.bodies
        elastic_forces(
            bodies.formulations, at, bodies.first, bodies.kinds, bodies.constants, self.buffer, out
        )
        self.connected.subtract(self.q, at, self.damping, out)

    def stiffness(self, x: Array) -> Array:
        """K_T x, by a central difference of the forces."""
        p = self.join.spread(x)
        h = DIFFERENCE / max(float(np.abs(p[2:]).max()), float(np.abs(p[:2]).max()) / self.length, 1e-300)
        self._force(self.q + h * p, self.up)
        self._force(self.q - h * p, self.down)
        return self.join.gather((self.up - self.down) / (2.0 * h))

    def mass(self, x: Array) -> Array:
        """M x."""
        out = np.empty_like(self.q)
        mass_product(self.join.spread(x), self.bodies.first, self.bodies.masses, self.buffer, out)
        return self.join.gather(out)

    def divided(self, f: Array) -> Array:
        """M⁻¹ f, by a sweep of the recursion."""
        return self.join.unknowns(solve(self.inverse, self.join.load(f)))


def _by_dense_matrices(small: _Linearised) -> float:
    """The highest frequency by all eigenvalues of M⁻¹K, rad/s."""
    units = np.eye(small.join.size)
    K = np.stack([small.stiffness(e) for e in units])
    A = np.stack([small.divided(row) for row in K])
    free = np.linalg.pinv(np.stack([small.mass(e) for e in units]), hermitian=True) @ K
    springs_are_held = np.abs(A).max() <= HELD * np.abs(free).max()  # by joints: the rest is rounding
    if springs_are_held:
        return 0.0
    return sqrt(max(0.0, float(np.max(np.real(np.linalg.eigvals(A))))))


def _by_lanczos(small: _Linearised) -> float:
    """The highest frequency by Lanczos iteration, rad/s."""
    n = small.join.size
    operators = [
        scipy.sparse.linalg.LinearOperator((n, n), matvec=g, dtype=float)
        for g in (small.stiffness, small.mass, small.divided)
    ]
    start = np.random.default_rng(0).standard_normal(n)
    try:
        value = scipy.sparse.linalg.eigsh(
            operators[0],
            1,
            operators[1],
            Minv=operators[2],
            which="LM",
            v0=start,
            tol=1e-7,
            return_eigenvectors=False,
        )[0]
    except scipy.sparse.linalg.ArpackNoConvergence as error:
        value = max(error.eigenvalues, default=0.0)
    return sqrt(max(float(value), 0.0))


def largest_step(chain: Chain, q: Array) -> float:
    """Largest stable Zhai step of a scene linearised about a configuration, s; infinite if it is unknown."""
    if zhai_limit(chain.run.psi, chain.run.phi) == 0.0:
        return inf
    try:
        return step_limit(chain.run.psi, chain.run.phi, highest_frequency(chain, q), highest_rate(chain))
    except (scipy.sparse.linalg.ArpackError, np.linalg.LinAlgError):
        return inf


def highest_rate(chain: Chain) -> float:
    """Largest rate c of decay by damping in q̈ + c q̇ + … of the undeformed scene, 1/s; 0 without damping."""
    damping = chain.bodies.damping
    if damping is None and not Connected(chain).damped:
        return 0.0
    rates = np.zeros(len(chain.bodies.meshes)) if damping is None else damping
    return highest_frequency(chain, bodies=chain.bodies.stiffened(rates), damping=True) ** 2


def element_bound(chain: Chain, bodies: Bodies | None = None) -> float:
    """Largest frequency of any single free element, an upper bound of ω_max (Irons & Treharne 1971), rad/s.

    With other `bodies` of the same nodes, theirs.
    """
    meshes = (bodies or chain.bodies).meshes
    found = (mesh.element.highest_frequency for mesh in meshes if isinstance(mesh, BodyMesh))
    return max(found, default=0.0)


def safe_step(chain: Chain) -> float:
    """A stable Zhai step of the undeformed scene, s, from bounds of its highest frequency and rate of damping.

    It is no longer than `largest_step` and far cheaper; infinite where nothing can vibrate.
    """
    damping = chain.bodies.damping
    bound = 0.0 if damping is None else element_bound(chain, chain.bodies.stiffened(damping)) ** 2
    stiff, lossy = Connected(chain).bounds()
    return step_limit(chain.run.psi, chain.run.phi, sqrt(element_bound(chain) ** 2 + stiff), bound + lossy)


def check_step(chain: Chain) -> None:
    """Refuse a step above the stability limit.

    Raises
    ------
    StabilityError
        Naming the step and the largest one allowed.
    """
    run: Discretisation = chain.run
    if zhai_limit(run.psi, run.phi) == 0.0:
        raise StabilityError(
            f"psi is {run.psi!r} and phi is {run.phi!r}; psi = phi >= 0.5 is needed; other pairs are unstable "
            f"at any step or have no larger stable step (check_stability=False runs it all the same)"
        )
    if run.dt <= safe_step(chain) and chain.start is None:  # a preload changes frequencies
        return
    frequency, rate = highest_frequency(chain, chain.start_coordinates()), highest_rate(chain)
    limit = step_limit(run.psi, run.phi, frequency, rate)
    if run.dt > limit:
        also = f", its highest rate of damping {rate:.6g} 1/s" if rate > 0.0 else ""
        raise StabilityError(
            f"dt is {run.dt!r} s; at most {limit:.6g} s is stable: the highest frequency of scene "
            f"{chain.scene.name!r} as discretised is {frequency:.6g} rad/s{also} "
            f"(check_stability=False runs it all the same)"
        )
