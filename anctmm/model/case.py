"""A scene with the data that studies need: probes, length and output interval."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from anctmm.errors import CaseError, shown
from anctmm.model.places import written
from anctmm.model.scene import Probe, Scene, checked_scene
from anctmm.validation import positive, several

#: Parts of a motion after which histories are compared, where the case does not say.
OUTPUTS = 100
#: Largest number of probes: an infinite iterable is refused.
MOST_PROBES = 1000
#: Characters of a note.
LONGEST_NOTE = 10_000


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
    probes: tuple[Probe, ...]
    t_end: float | None
    output_dt: float | None = None
    note: str = ""

    if TYPE_CHECKING:  # what is accepted; attributes hold what became of it

        def __init__(
            self,
            scene: Scene,
            probes: Iterable[Probe],
            t_end: float | None,
            output_dt: float | None = None,
            note: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        checked_scene(self.scene)
        set_(self, "probes", _probes(self.scene, self.probes))
        if not isinstance(self.note, str) or len(self.note) > LONGEST_NOTE:
            raise CaseError(
                f"{self._what} has note {shown(self.note)}; a text of at most {LONGEST_NOTE} characters is needed"
            )
        set_(self, "note", str.__str__(self.note))
        if self.t_end is None:
            if self.output_dt is not None:
                raise CaseError(
                    f"{self._what} has output_dt {shown(self.output_dt)} without t_end; "
                    f"a static equilibrium has no times: None is needed"
                )
            return
        set_(self, "t_end", positive(f"{self._what}, t_end (s),", self.t_end, CaseError))
        if self.output_dt is None:
            set_(self, "output_dt", self.t_end / OUTPUTS)
        set_(self, "output_dt", positive(f"{self._what}, output_dt (s),", self.output_dt, CaseError))
        self._check_outputs()

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

    @property
    def _what(self) -> str:
        return f"case of scene {self.scene.name!r}"

    def _check_outputs(self) -> None:
        """Refuse a motion that is no whole number of intervals."""
        ratio = self.duration / self.interval
        count = max(round(ratio), 1)
        if abs(ratio - count) > 1e-6:
            raise CaseError(
                f"{self._what} has t_end {self.t_end!r} s, which is no whole number of output_dt {self.output_dt!r} s; "
                f"such as {self.duration / count!r} is needed"
            )


def _probes(scene: Scene, given: object) -> tuple[Probe, ...]:
    """Places of a scene, one or more, none twice."""
    needed = "a list of at least one place of the scene is needed, such as ['body.end', ('body', 0.5)]"
    what = f"case of scene {scene.name!r} has probes"
    found = several(what, given, MOST_PROBES, needed, CaseError)
    if not found:
        raise CaseError(f"{what} []; {needed}")
    probes = tuple(map(written, found))
    places = [scene.probe(probe) for probe in probes]
    for k, place in enumerate(places):
        if place in places[:k]:
            raise CaseError(
                f"case of scene {scene.name!r} has probe {shown(probes[k])} twice; once is allowed"
            )
    return probes
