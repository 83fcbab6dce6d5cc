"""The result of every solver: times, fields over the bodies, energies, cost and status."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import ResultError, UnknownNameError, listed, shown
from anctmm.model.accepted import ConnectorKind, JointKind
from anctmm.model.checks.parts import check_plane
from anctmm.model.connectors import Connector
from anctmm.model.rigid_bodies import CENTER, PointMass, RigidBody
from anctmm.model.scene import Beam, Probe, Scene
from anctmm.results.export import pictures, saving, tables, vtk
from anctmm.results.fields import Field, RigidField
from anctmm.results.internal_forces.actions import tension_of
from anctmm.results.internal_forces.reactions import reactions_of
from anctmm.results.internal_forces.section_forces import section_force
from anctmm.results.status import Status
from anctmm.results.whole_turns import WholeTurns

Array = NDArray[np.float64]
#: One place of a beam's axis or several, as fractions of its length; the name of a rigid body's point.
Fractions = float | str | Sequence[float] | Array


@dataclass(frozen=True)
class Energy:
    """Energies at the output times, J, each (n,); NaN where a solver does not give one.

    kinetic + strain + potential − work is constant in the exact motion. Of equilibria it is the potential energy under
    the whole loads of t = 0, and least, or at least stationary, where all of these act.

    Parameters
    ----------
    kinetic : ndarray
        Of all bodies.
    strain : ndarray
        Of bodies and springs.
    potential : ndarray
        Of gravity and of constant forces; zero in the undeformed scene.
    work : ndarray
        Done by drives, torques, laws, and forces that vary in time or follow their place, less the energy
        dissipated by damping.
    dissipated : ndarray, optional
        The part of the work that damping has taken, of materials and of connectors; of a law what its force loses when
        the rate changes its sign. NaN where a solver does not tell it apart.
    """

    kinetic: Array
    strain: Array
    potential: Array
    work: Array
    dissipated: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.dissipated is None:
            object.__setattr__(self, "dissipated", np.full(np.shape(self.work), np.nan))

    @classmethod
    def unknown(cls, n: int) -> "Energy":
        """All NaN."""
        return cls(*(np.full(n, np.nan) for _ in range(4)))

    @property
    def balance(self) -> Array:
        """Numerical error of the energy since t = 0, J, (n,): zero in the exact motion, positive if energy appeared.

        Of equilibria it is no error: while the loads grow, energy is exchanged with what lets them grow.
        """
        total = self.kinetic + self.strain + self.potential - self.work
        return total - total[:1]


@dataclass(frozen=True)
class Cost:
    """Cost of a run.

    Parameters
    ----------
    cpu_s, wall_s : float
        Processor and wall time of the steps, s.
    steps, newton_iterations, factorizations : int
    build_s : float
        Processor time of the rest of the call, s: building the system before the steps, the solution after them.
    compile_s : float
        Processor time of the compiler, s; not included in the others.
    """

    cpu_s: float = float("nan")
    wall_s: float = float("nan")
    steps: int = 0
    newton_iterations: int = 0
    factorizations: int = 0
    build_s: float = float("nan")
    compile_s: float = float("nan")


@dataclass(frozen=True, repr=False)
class Solution:
    """A solver's answer.

    Parameters
    ----------
    solver : str
    scene : Scene
    run : Discretisation or None
    t : ndarray, shape (n,)
        0, output_dt, … t_end, s; shorter if the run ended early. The last interval may be shorter.
        Of statics the load factors.
    fields : mapping of body name to Field
        Motion of each body.
    energy : Energy
    cost : Cost
    status : Status
    dofs : int
        Number of unknown coordinates of the discretised scene, as the solver counts them.
    stable : ndarray of bool, shape (n,), optional
        Of statics: whether each equilibrium is stable. None where that is not known, and of motions.
    static : bool
        Whether it holds equilibria under growing parts of the load.
    error_estimate : float, optional
        Error of time stepping, of a run with `verify=True`: see `anctmm.results.metrics.error_between`.
    """

    solver: str
    scene: Scene
    run: Discretisation | None
    t: Array
    fields: Mapping[str, Field]
    energy: Energy
    cost: Cost = field(default_factory=Cost)
    status: Status = field(default_factory=Status)
    dofs: int = 0
    stable: NDArray[np.bool_] | None = None
    static: bool = False
    error_estimate: float | None = None

    def __repr__(self) -> str:
        """The scene, the solver, the mesh and what came out, in a few lines."""
        unit = "load factors" if self.static else "s"
        span = f"{self.t[0]:g} … {self.t[-1]:g} {unit}" if len(self.t) else "none"
        error = "" if self.error_estimate is None else f"; error of time stepping {self.error_estimate:.2g}"
        return (
            f"Solution of scene {self.scene.name!r} by {self.solver!r}: {self.status}\n"
            f"  bodies   {listed(self.fields) if self.fields else 'none'}\n"
            f"  outputs  {len(self.t)}, {span}; {self.dofs} coordinates{error}\n"
            f"  cost     {self.cost.cpu_s:.3g} s CPU, {self.cost.steps} steps, "
            f"{self.cost.newton_iterations} Newton corrections"
        )

    @cached_property
    def whole_turns(self) -> WholeTurns:
        """Angles of sections since the undeformed scene."""
        check_plane(self.scene, "angles")
        return WholeTurns(self.fields, self.t)

    @cached_property
    def _reactions(self) -> list[Array]:
        """Reactions of all joints, in the scene's order."""
        return reactions_of(self)

    def position(self, place: Probe, fraction: Fractions | None = None) -> Array:
        """Positions of a material point, (n, dim), m; of k fractions (n, k, dim).

        Parameters
        ----------
        place : str or (str, float)
            "name.start", "name.end" or, with a fraction, the name of a beam; "name.point" of a rigid body,
            "name.center" of it or of a point mass.
        fraction : float or sequence of float, optional
            Of the undeformed length from the beam's start, in [0, 1].

        Raises
        ------
        UnknownNameError, PropertyError
            If there is no such place.
        """
        return self._read(place, fraction, self._of_field("position"), self.scene.dim)

    def velocity(self, place: Probe, fraction: Fractions | None = None) -> Array:
        """Velocities of a material point, (n, 2), m/s; of k fractions (n, k, 2). Parameters as of `position`.

        Raises
        ------
        ResultError
            If the solver stores no velocities, or the solution is static.
        """
        return self._read(place, fraction, self._of_field("velocity"), self.scene.dim)

    def angle(self, place: Probe, fraction: Fractions | None = None) -> Array:
        """Angles by which sections have rotated since the first output, counter-clockwise.

        The direction of a section is the one on which a torque acts: the tangent of a cable's axis, r_y of a shear
        element. Angles include whole turns.

        Parameters
        ----------
        place, fraction
            As of `position`; for a rigid body its name is enough.

        Returns
        -------
        ndarray, shape (n,)
            rad; of k fractions (n, k).

        Notes
        -----
        ANC-TMM and the global DAE count whole turns at each step. For the other solvers outputs must be less than half
        a turn apart.

        Raises
        ------
        ResultError
            If the solver stores no angles, or the place is that of a point mass, which has none.
        """
        angles = self._read(self._turning(place, fraction), fraction, self.whole_turns.angle)
        return np.asarray(angles - angles[:1])

    def rotation(self, body: str) -> Array:
        """Matrices that turn vectors of the reference into those of a rigid body in space, (n, 3, 3).

        Raises
        ------
        UnknownNameError
            If the scene has no such body.
        ResultError
            If it is no rigid body in space.
        """
        field = self.fields.get(self.scene.body(body).name)
        if not isinstance(field, RigidField) or not field.axes:
            raise ResultError(f"body {body!r} has no matrix of rotation; a RigidBody in space is needed")
        return field.rotation()

    def spin(self, place: Probe, fraction: Fractions | None = None) -> Array:
        """Rates of the angles that `angle` gives, (n,) or (n, k), rad/s; parameters as of `angle`, errors as of
        `velocity`.
        """
        check_plane(self.scene, "angles")
        return self._read(self._turning(place, fraction), fraction, self._of_field("spin"))

    def section_force(self, place: Probe, fraction: Fractions | None = None) -> Array:
        """Section forces N, Q, M: those of the part of a beam beyond a section on the part before it.

        N acts along the tangent, Q along the normal (the tangent rotated by +90°), M counter-clockwise: see
        `anctmm.results.internal_forces.section_forces`.

        Parameters
        ----------
        place, fraction
            As of `position`.

        Returns
        -------
        ndarray, shape (n, 3)
            N, N, N m; of k fractions (n, k, 3).

        Raises
        ------
        ResultError
            If the solution is not one of ANCF elements with accelerations, or the beam is of element "rigid".
        UnknownKindError
            If the body is no beam.
        """
        check_plane(self.scene, "section forces")
        return self._read(place, fraction, lambda name, at: section_force(self, name, at), 3)

    def reaction(self, joint: JointKind) -> Array:
        """Force, N, and moment, N m, of a joint on its first place, in fixed axes, (n, 3), or (n, 6) in space.

        For a driven clamp the moment is the torque of its drive. Of a joint of several places that is grounded it is
        what the ground and the other places exert together; a pin of its own at one of these has the support's.
        Joints that repeat each other have the least reactions that balance.

        Raises
        ------
        UnknownNameError
            If the joint is not of the scene.
        ResultError
            If the solution does not have what reactions are found from: see
            `anctmm.results.internal_forces.reactions`.
        """
        self._check_member("joint", joint, self.scene.joints)
        return self._reactions[self.scene.joints.index(joint)].copy()

    def tension(self, connector: ConnectorKind) -> Array:
        """Tension of a spring, N, or the moment of a rotational spring against its angle, N m, (n,).

        Raises
        ------
        UnknownNameError
            If the connector is not of the scene.
        """
        self._check_member("connector", connector, self.scene.connectors)
        return tension_of(self, cast(Connector, connector))

    def displacement(self, probe: Probe) -> Array:
        """Displacements of a probe from its place at the first output, (n, dim), m."""
        path = self.position(probe)
        return path - path[:1]

    save = saving.save
    to_frame = tables.to_frame
    to_dataset = tables.to_dataset
    to_vtk = vtk.to_vtk
    plot = pictures.plot
    animate = pictures.animate

    def _read(
        self, place: Probe, fraction: Fractions | None, read: Callable[[str, Any], Array], *width: int
    ) -> Array:
        """What is read of a body at a place, (n, *width), or at each of k fractions, (n, k, *width)."""
        if isinstance(fraction, list | tuple) or (type(fraction) is np.ndarray and fraction.ndim == 1):
            parts = [self._one(self._given(place, x), read, *width) for x in fraction]
            return np.stack(parts, axis=1) if parts else np.empty((len(self.t), 0, *width))
        return self._one(place if fraction is None else self._given(place, fraction), read, *width)

    def _one(self, place: Probe, read: Callable[[str, Any], Array], *width: int) -> Array:
        name, at = self.scene.probe(place)
        return read(name, at) if self.fields else np.empty((0, *width))

    def _given(self, place: Probe, fraction: Any) -> Probe:
        """A place as the scene knows it: also of a rigid body and its point, given apart."""
        named = isinstance(fraction, str) and isinstance(place, str)
        if named and not isinstance(self.scene.body(place), Beam):  # type: ignore[arg-type]
            return f"{place}.{fraction}"
        return place, fraction  # type: ignore[return-value]

    def _of_field(self, what: str) -> Callable[[str, Any], Array]:
        return lambda name, at: getattr(self.fields[name], what)(at)  # type: ignore[no-any-return]

    def _check_member(self, what: str, thing: object, things: tuple[Any, ...]) -> None:
        if not isinstance(thing, JointKind | ConnectorKind) or thing not in things:
            raise UnknownNameError(
                f"{what} {shown(thing)} is not in scene {self.scene.name!r}; one of `scene.{what}s` is needed, which "
                f"has {len(things)}"
            )

    def _turning(self, place: Probe, fraction: Fractions | None) -> Probe:
        """A place that turns: a rigid body may be given by its name alone."""
        if not isinstance(place, str):
            return place
        if fraction is None and any(isinstance(b, RigidBody) and b.name == place for b in self.scene.bodies):
            with suppress(UnknownNameError):  # a point of another body has that name, too
                self.scene.place(place)
                return place
            return f"{place}.{CENTER}"
        name = place.removesuffix(f".{CENTER}")
        if any(isinstance(b, PointMass) and b.name == name for b in self.scene.bodies):
            raise ResultError(f"point mass {name!r} has no angle; position and velocity are what it has")
        return place

    def until(self, outputs: int, status: Status) -> "Solution":
        """The first outputs, with the status that says why the others are left out."""
        fields = {
            name: field.until(outputs) if hasattr(field, "until") else field
            for name, field in self.fields.items()
        }
        energy = Energy(*(series[:outputs] for series in vars(self.energy).values()))
        stable = None if self.stable is None else self.stable[:outputs]
        return replace(self, t=self.t[:outputs], fields=fields, energy=energy, status=status, stable=stable)

    def with_cost(self, cost: Cost) -> "Solution":
        """The same solution with another cost."""
        return replace(self, cost=cost)


def load(path: str | PathLike[str], scene: Scene | None = None) -> Solution:
    """The solution that `Solution.save` wrote.

    Parameters
    ----------
    path : path
    scene : Scene, optional
        The scene of the solution, if it has functions of yours; without it these cannot be called.

    Returns
    -------
    Solution
        Bit for bit as saved.

    Raises
    ------
    ResultError
        If the file does not exist, is no saved solution, is damaged, or belongs to a version with other classes or to
        another scene.
    """
    found = saving.load(path, scene)
    if not isinstance(found, Solution):
        raise ResultError(f"file {str(path)!r} holds a {type(found).__name__}; a solution is needed")
    return found
