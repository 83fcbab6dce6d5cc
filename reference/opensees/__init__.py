"""OpenSees: plane frames of beams that follow their chords (corotational), stepped implicitly.

Whatever element a discretisation names, this solver uses OpenSees' own beams without shear, which tend to the
extensible elastica. A model runs in a process of its own: OpenSees keeps one model a process, prints, and may end the
process that uses it. The cost is the processor time of its steps, measured inside that process; all else, the
start of the process included, is `build_s`. OpenSees counts the Newton corrections of the last step only, so that
`newton_iterations` stays 0. OpenSees is optional, the extra `peers`.

Steps begin with accelerations of zero unless these are given, which makes all schemes of first order;
`GeneralizedAlpha` converges linearly within a step, `HHTGeneralized`, the same scheme, quadratically; beams with a
consistent mass keep it in their first direction, an error of second order in the elements' length.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from time import process_time
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, discretise, parts_of_load
from anctmm.elements.kinds import optional_beside
from anctmm.errors import UnsupportedError, shown
from anctmm.model.drives import tabulate
from anctmm.model.needs import MECHANISMS
from anctmm.model.scene import Beam, Clamp, Force, Pin, Scene, Torque, Weld
from anctmm.results.fields import InterpolatedField
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of
from reference.adapters import Adapter, Answer, nodes_of, undamped
from reference.opensees.frame import BEAMS, Frame
from reference.opensees.process import PACKAGES, Analysis, analyse

Array = NDArray[np.float64]

#: Solvers of linear equations: those that were found to work; SparseSYM was seen to give wrong corrections.
SYSTEMS = ("ProfileSPD", "BandGeneral", "BandSPD", "UmfPack", "SuperLU")
ALGORITHMS = ("Newton", "ModifiedNewton", "KrylovNewton", "BFGS", "NewtonLineSearch")
#: What was the cheapest somewhere, over mesh, step and tolerance, on the falling cantilever: the nonlinear beam, BFGS
#: and KrylovNewton never were.
CHOICES: tuple[Mapping[str, Any], ...] = (
    {"newton_tolerance": 1e-3},
    {"newton_tolerance": 1e-5},
    {"newton_tolerance": 1e-5, "algorithm": "ModifiedNewton"},
    {"newton_tolerance": 1e-3, "beam": "elastic-lumped"},
)
OFFER = Offer(
    lacks=optional_beside(("cable", "shear"))
    | {"zhai", "esdirk", "damping", "stability", "energy", *MECHANISMS},
    element="frame",
    limits={"cable": "elastica"},
    choices=CHOICES,
)
#: Angles at most beyond half a turn that rounding leaves, rad; part of half a turn above which a chord is the reason of
#: a failure.
ROUNDING, NEAR = 1e-9, 0.85


def solve(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    beam: str = "elastic",
    algorithm: str = "Newton",
    system: str = "ProfileSPD",
    **options: Any,
) -> Solution:
    """Motion of a scene by OpenSees.

    Parameters
    ----------
    scene : Scene
        Beams joined in any way by pins and welds: chains, trees, loops; clamps turn by half a turn at most.
    run : Discretisation, optional
        "generalized-alpha" is OpenSees' HHTGeneralized. `newton_tolerance` bounds the norm of a correction, of
        displacements and rotations. `element` and `quadrature` are not used. Or its fields as keywords.
    beam : str
        "elastic": elasticBeamColumn with a consistent mass; "elastic-lumped": with masses at its nodes; "nonlinear":
        dispBeamColumnNL, whose rotations stretch its axis, with masses at its nodes.
    algorithm : str
        Newton's iteration, one of `ALGORITHMS`.
    system : str
        OpenSees' solver of linear equations, one of `SYSTEMS`.

    Returns
    -------
    Solution
        With status "unsupported" where OpenSees is missing or cannot do the scene, "failed" where it gives up, or its
        process ends.
    """
    return Frames(scene, discretise(run, options), beam=beam, algorithm=algorithm, system=system).solution()


def solve_static(
    scene: Scene,
    run: Discretisation | None = None,
    *,
    load_steps: int = 10,
    beam: str = "nonlinear",
    algorithm: str = "Newton",
    system: str = "BandGeneral",
    **options: Any,
) -> Solution:
    """Equilibrium of a scene by OpenSees; `t` of the solution are load factors.

    Parameters
    ----------
    scene : Scene
        Loads and drives as they are at t = 0.
    run : Discretisation, optional
        Or its fields as keywords; its mesh is used.
    load_steps : int
        Equal steps of the load; those that fail are halved.
    beam, algorithm, system
        As for `solve`. The nonlinear beam has the smaller error by two powers of ten on a mesh of eight elements.
    """
    run, load_steps = discretise(run, options), parts_of_load(load_steps)
    return Frames(scene, run, True, load_steps, beam=beam, algorithm=algorithm, system=system).solution()


@dataclass
class Frames(Adapter):
    """A scene in OpenSees; parameters as of `solve` and `solve_static`."""

    beam: str = "elastic"
    algorithm: str = "Newton"
    system: str = "ProfileSPD"

    name: ClassVar[str] = "opensees"
    title: ClassVar[str] = "a model in OpenSees"
    packages: ClassVar[tuple[str, ...]] = PACKAGES
    offer: ClassVar[Offer] = OFFER
    memory: ClassVar[tuple[float, float]] = (1_500.0, 150.0)
    integrators: ClassVar[Mapping[str, str]] = {
        "zhai": (
            "OpenSees' explicit steps need a mass for every coordinate, and its beams give rotations none that is "
            "diagonal: 'generalized-alpha' is needed"
        ),
        "esdirk": "OpenSees' implicit steps are of second order: 'generalized-alpha' is needed",
    }

    def __post_init__(self) -> None:
        self.began = process_time()
        one_of("beam", self.beam, BEAMS)
        one_of("algorithm", self.algorithm, ALGORITHMS)
        one_of("system", self.system, SYSTEMS)

    @classmethod
    def version(cls) -> str:
        """Version of the code; empty where it is not installed, or hidden."""
        return super().version() if any(map(_there, PACKAGES)) else ""

    def check(self) -> None:
        """Refuse damping, unknown kinds, and clamps that turn too far: a chord's angle is taken in (−π, π]."""
        undamped(self.scene, "OpenSees damps whole models by stiffness matrices that turn nothing")
        for thing, kinds in (
            *((j, Pin | Weld | Clamp) for j in self.scene.joints),
            *((x, Force | Torque) for x in self.scene.loads),
        ):
            if not isinstance(thing, kinds):
                raise UnsupportedError(
                    f"{shown(thing)} of type {type(thing).__name__} is not known to {self.title}"
                )
        for clamp, angles in () if self.static else self._driven():
            far = np.flatnonzero(np.abs(angles) > np.pi + ROUNDING)
            if far.size:
                time = float(self.run.times(far[:1])[0])
                raise UnsupportedError(
                    f"{shown(clamp)} has turned by more than half a turn at t = {time:.6g} s; OpenSees' frames turn "
                    f"with their chords, whose angles jump from π to −π; there Newton's iteration fails on every mesh: "
                    f"at most half a turn is needed"
                )

    def build(self) -> Frame:
        """Nodes and elements."""
        return Frame(self.scene, self.run, self.beam, self.static)

    def march(self, model: Frame) -> Answer:
        """Analyse in a process of its own."""
        steps = self.load_steps if self.static else self.run.steps
        analysis = analyse(model.job(self.system, self.algorithm, steps))
        t = analysis.t
        if not self.static:
            t = self.run.times(self.run.output_steps)[: len(t)]
            analysis = _as_driven(model, t, analysis)
        turns = _chord_turns(model, analysis)
        kept, status = len(t), Status()
        if (beyond := np.flatnonzero((np.abs(turns) > np.pi).any(axis=1))).size:
            kept = int(beyond[0])
            time = float(t[kept])
            status = Status("failed", *_too_far(model, turns[kept], time))
        elif analysis.trouble:
            status = self._failure(model, analysis, turns)
        fields = {body.name: _field(model, body, analysis).until(kept) for body in self.scene.beams}
        spent = process_time() - self.began + analysis.whole - analysis.cpu
        cost = Cost(analysis.cpu, analysis.wall, analysis.steps, build_s=spent, compile_s=0.0)
        return Answer(t[:kept], fields, cost, status, model.dofs)

    def _driven(self) -> Iterator[tuple[Clamp, Array]]:
        """Driven clamps with their angles at the steps, rad."""
        for joint in self.scene.joints:
            if isinstance(joint, Clamp) and joint.angle is not None:
                t = self.run.times(np.arange(self.run.steps + 1))
                yield joint, tabulate(f"clamp {joint.end!r} angle", joint.angle, t, 3)[:, 0]

    def _failure(self, frame: Frame, analysis: Analysis, turns: Array) -> Status:
        run, reached = self.run, float(analysis.t[-1]) if len(analysis.t) else 0.0
        time, step = reached, None
        where, advice = f"beyond load factor {reached:.6g}", "more load_steps may help, and hold every body"
        if not self.static:
            step = min(analysis.steps + 1, run.steps)
            time = float(run.times(np.array([step]))[0])
            where, advice = f"in step {step} (t = {time:.6g} s)", f"a dt below {run.dt:g} s may help"
        if len(turns) and np.abs(turns[-1]).max() > NEAR * np.pi:
            why, _, _, body, element = _too_far(frame, turns[-1], time)
            return Status("failed", f"{analysis.trouble} {where}: {why}", time, step, body, element)
        return Status("failed", f"{analysis.trouble} {where}; {advice}", time, step)


def _there(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ValueError:  # set to None, as where it is hidden
        return False


def _as_driven(frame: Frame, t: Array, analysis: Analysis) -> Analysis:
    """The same with driven clamps at the angles of their drives, which OpenSees leaves where the step's balance was."""
    assert analysis.velocities is not None
    u, v = analysis.displacements.copy(), analysis.velocities.copy()
    for tag, name, drive in frame.driven:
        angles = tabulate(name, drive, t, 3)
        u[:, tag - 1, 2], v[:, tag - 1, 2] = angles[:, 0], angles[:, 1]
    return replace(analysis, displacements=u, velocities=v)


def _chords(frame: Frame, body: Beam, analysis: Analysis) -> tuple[Array, Array]:
    """Places of a body's nodes, (n, nodes, 2), and its rotations, (n, nodes)."""
    q = analysis.displacements[:, np.array(frame.of_body[body.name]) - 1]
    return nodes_of(body, frame.counts[body.name])[0] + q[..., :2], q[..., 2]


def _chord_turns(frame: Frame, analysis: Analysis) -> Array:
    """Angles that all chords have turned by, (n, elements), rad; whole turns are those of the nodes' rotations."""
    found = []
    for body in frame.scene.beams:
        places, angles = _chords(frame, body, analysis)
        chords = np.diff(places, axis=1)
        seen = np.arctan2(chords[..., 1], chords[..., 0]) - body.angle
        mean = 0.5 * (angles[:, 1:] + angles[:, :-1])
        found.append(seen + 2.0 * np.pi * np.round((mean - seen) / (2.0 * np.pi)))
    return np.concatenate(found, axis=1)


def _too_far(frame: Frame, turns: Array, time: float) -> tuple[str, float, None, str, int]:
    """Message, time, step, body and element of the chord that has turned furthest."""
    index = int(np.argmax(np.abs(turns)))
    angle = turns[index]
    ends = np.cumsum([*frame.counts.values()])
    k = int(np.searchsorted(ends, index, side="right"))
    body, index = [*frame.counts][k], index - int(ends[k]) + [*frame.counts.values()][k]
    why = (
        f"element {index} of body {body!r} has turned by {angle:.3g} rad; OpenSees' frames, which turn with their "
        f"chords, know no more than half a turn from the start"
    )
    return why, time, None, body, index


def _field(frame: Frame, body: Beam, analysis: Analysis) -> InterpolatedField:
    """Axis through the nodes in their directions; its stretch at a node is that of the chords beside it."""
    places, angles = _chords(frame, body, analysis)
    chords = np.linalg.norm(np.diff(places, axis=1), axis=-1) / frame.element_length(body)
    stretch = np.empty(angles.shape)
    stretch[:, 0], stretch[:, -1] = chords[:, 0], chords[:, -1]
    stretch[:, 1:-1] = 0.5 * (chords[:, 1:] + chords[:, :-1])
    angle = body.angle + angles
    slope = stretch[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rates = None
    if analysis.velocities is not None:
        v = analysis.velocities[:, np.array(frame.of_body[body.name]) - 1]
        turning = v[..., 2:] * np.stack([-slope[..., 1], slope[..., 0]], axis=-1)
        rates = np.stack([v[..., :2], turning], axis=2)
    return InterpolatedField(np.stack([places, slope], axis=2), body.length, rates)
