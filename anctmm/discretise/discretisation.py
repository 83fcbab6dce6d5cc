"""What a convergence study varies: mesh, element, integrator, step and output."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.methods import METHODS, Esdirk, GeneralizedAlpha, Method
from anctmm.elements.kinds import QUADRATURES, kind_of
from anctmm.errors import (
    DiscretisationError,
    MeshError,
    StepError,
    UnsupportedError,
    listed,
    shown,
)
from anctmm.model.scene import Scene, checked_scene
from anctmm.validation import FrozenMapping, flag, one_of, positive, whole, within

INTEGRATORS = tuple(METHODS)
#: Elements of a body at most: sparse matrices number their rows by 32 bits.
MOST = 2**31 - 1
#: Steps of a run at most: whole numbers up to here are exact as floats.
MOST_STEPS = 2.0**53


class _NotGiven(float):
    """A default that can be distinguished from the same number given by the user."""


NOT_GIVEN = _NotGiven(1e-3)
#: Bound of Newton's last correction where none is given; with a tolerance, the error that a step may make bounds it.
TIGHT = _NotGiven(1e-10)


@dataclass(frozen=True)
class Discretisation:
    """Mesh, element, integrator, step and output of a run.

    Parameters
    ----------
    mesh : int or mapping of body name to int, optional
        Elements of each beam; a scene without beams needs none.
    element : str or mapping of body name to str
        "cable" (gradient-deficient, Euler-Bernoulli), "quintic" (such a cable of order 8), "shear" (the paper's) or
        "rigid" (a thin bar; its mesh is 1).
    quadrature : str
        Of the cable: "full" (Gauss 5/3), "reduced" (Gauss 4/2) or "lobatto" (Lobatto 3, Gauss 2).
    integrator : Zhai, GeneralizedAlpha, Esdirk or str, optional
        A method with its parameters, or its name: "zhai" (explicit), "generalized-alpha" (implicit) or "esdirk"
        (implicit, fourth order). Stored as the name. Default: "generalized-alpha" with a fixed step, "esdirk" with a
        tolerance unless the spectral radius is given another value than its default.
    dt, t_end : float
        Step (default 1e-3) and length of the run, s; `t_end` is a whole number of steps.
    output_dt : float, optional
        Interval of the output, s; the last one, which ends at `t_end`, may be shorter. A fixed `dt` needs a whole
        number of steps. Default: every step, or with a tolerance a 200th of the run.
    tolerance : float, optional
        Target of the error in time, relative to the largest displacement, instead of `dt`: an estimate of the local
        error controls the step of "esdirk" or generalized-α. With "esdirk" outputs may lie within steps. Steps end at
        the breaks of loads and drives (`History`); in histories without stated breaks, a change is detected that lasts
        at least 1e-4 of the run.
    psi, phi : float
        Zhai's parameters ψ and φ (Rong 2014, eq. 38).
    spectral_radius : float
        ρ∞ of generalized-α, in [0, 1]. Parameters of methods other than the one named are checked and stored but not
        used, so that `dataclasses.replace(run, integrator="zhai")` can change the method and back. A method given as
        an object, such as `Esdirk()`, brings its own parameters.
    newton_tolerance : float
        Bound of the last Newton correction: of positions relative to the length of the scene, of gradients absolute.
        Default: 1e-10, and of ANC-TMM with n > 1000 steps 1e-4/n², because what corrections leave adds up over the
        steps. With a `tolerance` the bound follows from the allowed error of a step; this one applies only if it is
        smaller.
    check_stability : bool
        Whether to refuse an explicit step above the stability limit.

    Raises
    ------
    DiscretisationError
        Or one of its kinds, naming the option, its value and what is allowed.
    """

    mesh: Any = None
    element: Any = "cable"
    quadrature: str = "full"
    integrator: Any = None
    dt: float = NOT_GIVEN
    t_end: float = 1.0
    output_dt: float | None = None
    tolerance: float | None = None
    psi: float = 0.5
    phi: float = 0.5
    spectral_radius: float = 0.9
    newton_tolerance: float = TIGHT
    check_stability: bool = True
    steps: int = field(init=False, compare=False)
    stride: int = field(init=False, compare=False)
    newton_given: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        if self.mesh is not None:
            set_(self, "mesh", _by_body("mesh", self.mesh, lambda name, n: whole(name, n, MOST, MeshError)))
        set_(self, "element", _by_body("element", self.element, lambda name, kind: kind_of(kind, name).name))
        set_(self, "quadrature", one_of("quadrature", self.quadrature, QUADRATURES))
        if isinstance(self.integrator, Method):
            self._take(self.integrator)
        for method in METHODS.values():
            for name, value in vars(self._made(method)).items():
                set_(self, name, value)
        name = self._usual() if self.integrator is None else self.integrator
        set_(self, "integrator", one_of("integrator", name, INTEGRATORS))
        set_(self, "newton_given", not isinstance(self.newton_tolerance, _NotGiven))
        if self.newton_given:
            left = within("newton_tolerance", self.newton_tolerance, 0.0, 1e-2, "(]", DiscretisationError)
            set_(self, "newton_tolerance", left)
        set_(self, "check_stability", flag("check_stability", self.check_stability, DiscretisationError))
        for name in ("dt", "t_end"):
            if not isinstance(getattr(self, name), _NotGiven):
                set_(self, name, positive(f"{name} (s)", getattr(self, name), StepError))
        if self.output_dt is not None:
            set_(self, "output_dt", positive("output_dt (s)", self.output_dt, StepError))
        if self.tolerance is None:
            set_(self, "steps", _multiple("t_end (s)", self.t_end, self.dt))
            output_dt = self.dt if self.output_dt is None else self.output_dt
            set_(self, "stride", min(_multiple("output_dt (s)", output_dt, self.dt), self.steps))
        else:
            set_(self, "steps", _intervals(self.t_end, self._interval()))
            set_(self, "stride", 1)

    def _usual(self) -> str:
        """Name of the integrator where none is given; with a tolerance, of fourth order, which takes less work."""
        damped = self.spectral_radius != GeneralizedAlpha.spectral_radius
        return GeneralizedAlpha.name if self.tolerance is None or damped else Esdirk.name

    def _take(self, method: Method) -> None:
        """Name and parameters of a method given whole."""
        defaults = {f.name: f.default for f in fields(self)}
        for name, value in vars(method).items():
            if getattr(self, name) not in (defaults[name], value):
                raise DiscretisationError(
                    f"{name} is {shown(getattr(self, name))} beside integrator {method!r}; one of them is allowed"
                )
            object.__setattr__(self, name, value)
        object.__setattr__(self, "integrator", method.name)

    def _made(self, method: type[Method]) -> Method:
        return method(**{f.name: getattr(self, f.name) for f in fields(method)})

    @cached_property
    def method(self) -> Method:
        """The integrator with its parameters."""
        return self._made(METHODS[self.integrator])

    @property
    def explicit(self) -> bool:
        """Whether steps are explicit: bound by stability, and without iteration."""
        return METHODS[self.integrator].explicit

    def _interval(self) -> float:
        """With a tolerance, the interval of the output, s: `steps` then counts intervals."""
        tolerance = within("tolerance", self.tolerance, 0.0, 0.5, "()", StepError)
        object.__setattr__(self, "tolerance", tolerance)
        if not isinstance(self.dt, _NotGiven):
            raise StepError(f"dt is {self.dt!r} s beside tolerance {tolerance!r}; one of them is allowed")
        if self.explicit:
            raise StepError(
                f"tolerance is {tolerance!r} with integrator {self.integrator!r}; 'esdirk' or 'generalized-alpha' is "
                f"needed: stability bounds an explicit step, not accuracy"
            )
        return self.t_end / 200 if self.output_dt is None else self.output_dt

    @property
    def output_steps(self) -> NDArray[np.int64]:
        """Numbers of the steps whose result is kept: 0, the stride, … and the last."""
        kept = np.arange(0, self.steps + 1, self.stride)
        return kept if kept[-1] == self.steps else np.append(kept, self.steps)

    @property
    def exact_dt(self) -> float:
        """Step that fills the run exactly, s; `dt` may differ from it by rounding. With a tolerance, of the output."""
        return self._filled / self.steps

    @cached_property
    def _filled(self) -> float:
        """Time that all steps take, s: t_end, or more where the last interval of the output is shorter."""
        if self.tolerance is None or self.output_dt is None:
            return self.t_end
        equal = self.steps * self.output_dt
        filled = self.steps == 1 or equal - self.t_end <= _close(self.t_end, self.output_dt)
        return self.t_end if filled else equal

    def times(self, steps: NDArray[np.int64]) -> NDArray[Any]:
        """Times of numbered steps, s: t_end itself at the last, and none later."""
        return np.where(steps == self.steps, self.t_end, steps * self._filled / self.steps)

    def of(self, scene: Scene) -> dict[str, tuple[int, str]]:
        """Number and kind of the elements of every beam.

        Raises
        ------
        MeshError
            If a mapping misses a beam of the scene or names one it does not have, or a rigid one has several elements.
        UnknownOptionError
            If a kind of element is not known.
        UnsupportedError
            If a joint acts between the ends of a beam whose elements need it at an end.
        """
        checked_scene(scene, space=True)
        names = [b.name for b in scene.beams]
        if self.mesh is None and names:
            raise MeshError(
                f"mesh is missing; a number of elements, or one for every beam, is needed: {listed(names)}"
            )
        for what in ("mesh", "element"):
            value = getattr(self, what)
            if isinstance(value, Mapping) and set(value) != set(names):
                raise MeshError(
                    f"{what} is {shown(dict(value))}; every beam of scene {scene.name!r} and no other is needed: "
                    f"{listed(names)}"
                )
        cut = {n: (_pick(self.mesh, n), _pick(self.element, n)) for n in names}
        for name, (elements, kind) in cut.items():
            if kind_of(kind, f"element of body {name!r}").rigid and elements != 1:
                raise MeshError(f"mesh is {elements!r} for rigid body {name!r}; 1 is needed")
        _refuse_inside(scene, cut)
        return cut


def _refuse_inside(scene: Scene, cut: Mapping[str, tuple[int, str]]) -> None:
    """Refuse joints between the ends of beams whose elements need them at an end."""
    places = [(joint, scene.place(end)) for joint in scene.joints for end in joint.places]
    for joint, place in places:
        if place.interior and not (kind := kind_of(cut[place.body.name][1])).jointed_inside:
            raise UnsupportedError(
                f"{shown(joint)} acts at {place}, between the ends of a beam of element {kind.name!r}, whose second "
                f"derivative is continuous there; two beams welded to each other there are needed, or another element"
            )


def discretise(
    run: Discretisation | None, options: dict[str, Any], *, fixed_step: bool = True
) -> Discretisation:
    """A discretisation given whole, or as keywords; `fixed_step`: whether the calling solver has fixed steps only.

    Raises
    ------
    DiscretisationError
        If both are given, or a keyword is unknown, or a tolerance is given to a solver of fixed step.
    """
    allowed = [f.name for f in fields(Discretisation) if f.init]
    if run is not None and (options or type(run) is not Discretisation):
        raise DiscretisationError(
            f"run is {shown(run)} beside keywords {sorted(options)}; a Discretisation or keywords are allowed"
        )
    if unknown := sorted(set(options) - set(allowed)):
        raise DiscretisationError(f"option {unknown[0]!r} is unknown; allowed are {', '.join(allowed)}")
    run = run or Discretisation(**options)
    if fixed_step and run.tolerance is not None:
        raise StepError(
            f"tolerance is {run.tolerance!r}, but this solver does not choose its steps; a fixed dt, or none for "
            f"equilibria and modes, is allowed"
        )
    return run


def parts_of_load(load_steps: object) -> int:
    """Return a number of load steps, a whole number from 1 on, or refuse it by a DiscretisationError."""
    return whole("load_steps", load_steps, 1_000_000, DiscretisationError)


def _by_body(what: str, value: Any, check: Callable[[str, Any], Any]) -> Any:
    """One value, or one for each of some bodies, checked."""
    if not isinstance(value, Mapping):
        return check(what, value)
    if strange := [name for name in value if not isinstance(name, str)]:
        raise MeshError(
            f"{what} is {shown(value)}; names of bodies are needed in place of {shown(strange[0])}"
        )
    return FrozenMapping({name: check(f"{what} of body {name!r}", one) for name, one in value.items()})


def _pick(value: Any, name: str) -> Any:
    return value[name] if isinstance(value, Mapping) else value


def _multiple(name: str, value: float, dt: float) -> int:
    count = round(_ratio(name, value, dt, "steps dt"))
    if count < 1 or abs(count * dt - value) > 1e-6 * dt:
        nearest = float(f"{max(count, 1) * dt:.12g}")
        raise StepError(
            f"{name} is {value!r}; a whole number of steps dt = {dt!r} s is needed, such as {nearest!r}"
        )
    return count


def _intervals(t_end: float, output_dt: float) -> int:
    """Number of intervals of the output, the last of which may be shorter."""
    ratio = _ratio("t_end (s)", t_end, output_dt, "intervals output_dt")
    return max(1, ceil(ratio - _close(t_end, output_dt) / output_dt))


def _close(t_end: float, output_dt: float) -> float:
    """Difference of times that is none, s: no step with a tolerance is so short."""
    return max(1e-6 * output_dt, 1e-8 * t_end)


def _ratio(name: str, value: float, dt: float, parts: str) -> float:
    ratio = value / dt
    if not ratio <= MOST_STEPS:
        raise StepError(
            f"{name} is {value!r} with {parts} = {dt!r} s, {ratio:.3g} of them; at most {MOST_STEPS:.3g} are "
            f"allowed, beyond which step numbers are not exact"
        )
    return ratio
