"""A scene with the data that studies need: probes, length and output interval."""

from collections.abc import Sequence
from dataclasses import dataclass

from anctmm.errors import CaseError, shown
from anctmm.model.places import written
from anctmm.model.scene import Probe, Scene, checked_scene
from anctmm.validation import positive, several


@dataclass(frozen=True)
class Case:
    """A scene with its probes and the length of its motion.

    A case names no mesh, step or solver: studies choose them, and estimate the uncertainty of their results.

    Parameters
    ----------
    scene : Scene
    probes : iterable of str or (str, float)
        One or more places of the scene, whose motion is compared: "name.start", "name.end", ("name", fraction) of a
        beam, "name.point" of a rigid body.
    t_end : float or None
        Length of the motion, s; None: the static equilibrium under the full load.
    output_dt : float, optional
        Interval of the compared histories, s; `t_end` is a whole number of it. Default: a hundredth of the motion.
    note : str
        Shown with all results: what the scene is, what was assumed.

    Raises
    ------
    CaseError
        If something is missing, of another kind or out of its range.
    UnknownNameError, PropertyError
        If a probe is no place of the scene.

    Examples
    --------
    >>> from anctmm import Beam, Case, Circle, Clamp, Material, Scene
    >>> beam = Beam("beam", (0, 0), (1, 0), Circle(0.01), Material(E=1e9, density=2000))
    >>> case = Case(Scene("fall", [beam], [Clamp("beam.start")], gravity=(0, -9.81)), ["beam.end"], t_end=0.5)
    >>> case.name, case.output_dt
    ('fall', 0.005)
    """

    scene: Scene
    probes: Sequence[Probe]
    t_end: float | None
    output_dt: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        checked_scene(self.scene)
        what = f"case of scene {self.scene.name!r}"
        set_(self, "probes", _probes(self.scene, f"{what} has probes", self.probes))
        if not isinstance(self.note, str):
            raise CaseError(f"{what} has note {shown(self.note)}; a text is needed")
        if self.t_end is None:
            if self.output_dt is not None:
                raise CaseError(
                    f"{what} has output_dt {shown(self.output_dt)} without t_end; a static equilibrium has no times"
                )
            return
        t_end = positive(f"{what}, t_end (s),", self.t_end, CaseError)
        each = t_end / 100 if self.output_dt is None else self.output_dt
        each = positive(f"{what}, output_dt (s),", each, CaseError)
        count = max(round(t_end / each), 1)
        if abs(t_end / each - count) > 1e-6:
            raise CaseError(
                f"{what} has t_end {t_end!r} s, which is no whole number of output_dt {each!r} s; such as "
                f"{t_end / count!r} is needed"
            )
        set_(self, "t_end", t_end)
        set_(self, "output_dt", each)

    @property
    def name(self) -> str:
        """The scene's."""
        return self.scene.name

    @property
    def static(self) -> bool:
        """Whether it is a static case."""
        return self.t_end is None

    @property
    def duration(self) -> float:
        """Length of the motion, s; zero for statics."""
        return self.t_end or 0.0

    @property
    def interval(self) -> float:
        """Interval of the compared histories, s; zero for statics."""
        return self.output_dt or 0.0


def _probes(scene: Scene, what: str, given: object) -> tuple[Probe, ...]:
    """Places of a scene, one or more, none twice."""
    needed = "a list of at least one place of the scene is needed, such as ['body.end', ('body', 0.5)]"
    probes = tuple(map(written, several(what, given, needed, CaseError)))
    if not probes:
        raise CaseError(f"{what} []; {needed}")
    places = [scene.probe(probe) for probe in probes]
    for k, place in enumerate(places):
        if place in places[:k]:
            raise CaseError(f"{what} {shown(probes[k])} twice; once is allowed")
    return probes
