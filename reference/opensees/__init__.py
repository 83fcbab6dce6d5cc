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

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import optional_beside
from anctmm.errors import UnsupportedError
from anctmm.model.drives import tabulate
from anctmm.model.needs import MECHANISMS
from anctmm.model.scene import Beam, Scene
from anctmm.results.fields import InterpolatedField
from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of
from reference.adapters import Adapter, Answer, nodes_of, not_installed, undamped
from reference.opensees.frame import BEAMS, Frame

Array = NDArray[np.float64]

WORKER = Path(__file__).with_name("worker.py")
#: Packages of OpenSees, of which one is needed; the same numbers were found by both.
PACKAGES = ("opensees", "openseespy")
#: Linear algebra inside OpenSees on one thread, as everywhere here.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
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
#: Angles at most beyond half a turn that rounding leaves, rad.
ROUNDING = 1e-9
#: Why a chord that has turned further is none that OpenSees knows.
HALF_TURN = (
    "OpenSees' frames turn with their chords, whose angles jump from π to −π: at most half a turn is needed"
)


def solve(scene: Scene, run: Discretisation | None = None, **options: Any) -> Solution:
    """Motion of a scene by OpenSees, "unsupported" where it cannot do the scene, "failed" where it gives up.

    Parameters
    ----------
    scene, run
        "generalized-alpha" is OpenSees' HHTGeneralized. `newton_tolerance` bounds the norm
        of a correction, of displacements and rotations. `element` and `quadrature` are not used.
    beam, algorithm : str
        Of `BEAMS`, "elastic" by default, and of `ALGORITHMS`, "Newton" by default.
    """
    return Frames.of(scene, run, options).solution()


def solve_static(
    scene: Scene, run: Discretisation | None = None, *, load_steps: int = 10, **options: Any
) -> Solution:
    """Equilibrium of a scene by OpenSees, loads and drives as they are at t = 0; `t` are load factors.

    Steps that fail are halved. By default with the nonlinear beam: its error is smaller, by two powers of ten with
    eight elements.
    """
    return Frames.of(scene, run, {"beam": "nonlinear"} | options, load_steps).solution()


@dataclass
class Frames(Adapter):
    """A scene in OpenSees; parameters as of `solve` and `solve_static`."""

    beam: str = "elastic"
    algorithm: str = "Newton"

    name: ClassVar[str] = "opensees"
    title: ClassVar[str] = "a model in OpenSees"
    packages: ClassVar[tuple[str, ...]] = PACKAGES
    offer: ClassVar[Offer] = OFFER
    memory: ClassVar[tuple[float, float]] = (1_500.0, 150.0)

    def __post_init__(self) -> None:
        self.began = process_time()
        one_of("beam", self.beam, BEAMS)
        one_of("algorithm", self.algorithm, ALGORITHMS)

    def check(self) -> None:
        """Refuse damping."""
        undamped(self.scene, "OpenSees damps whole models by stiffness matrices that turn nothing")

    def build(self) -> Frame:
        """Nodes and elements; clamps that turn too far are refused."""
        frame, t = (
            Frame(self.scene, self.run, self.beam, self.static),
            self.run.times(np.arange(self.run.steps + 1)),
        )
        for _, name, drive in frame.driven:
            far = np.flatnonzero(np.abs(tabulate(name, drive, t, 3)[:, 0]) > np.pi + ROUNDING)
            if far.size:
                raise UnsupportedError(
                    f"{name} is more than half a turn at t = {t[far[0]]:.6g} s; {HALF_TURN}"
                )
        return frame

    def march(self, model: Frame) -> Answer:
        """Analyse in a process of its own."""
        steps = self.load_steps if self.static else self.run.steps
        t, states, end = analyse(model.job(self.algorithm, steps))
        if not self.static:
            t = self.run.times(self.run.output_steps)[: len(t)]
        for tag, name, drive in model.driven:  # OpenSees leaves these where the step's balance was
            states[:, :, tag - 1, 2] = tabulate(name, drive, t, 3)[:, :2]
        kept, status = len(t), Status()
        turns = _chord_turns(model, states)
        if (beyond := np.flatnonzero(np.abs(turns).max(axis=1) > np.pi)).size:
            kept = int(beyond[0])
            status = self._too_far(model, turns[kept], float(t[kept]))
        elif end["trouble"]:
            reached = float(t[-1]) if len(t) else 0.0
            where, advice = f"beyond load factor {reached:.6g}", "more load_steps, and hold every body"
            if not self.static:
                reached = float(self.run.times(np.array([min(end["steps"] + 1, steps)]))[0])
                where, advice = f"before t = {reached:.6g} s", f"a dt below {self.run.dt:g} s"
            why = f"{end['trouble']} {where}; {advice} may help; {HALF_TURN}"
            status = Status("failed", why, reached)
        fields = {body.name: _field(model, body, states).until(kept) for body in self.scene.beams}
        spent = process_time() - self.began + end["whole"] - end["cpu"]
        cost = Cost(end["cpu"], end["wall"], end["steps"], build_s=spent, compile_s=0.0)
        return Answer(t[:kept], fields, cost, status, model.dofs)

    def _too_far(self, frame: Frame, turns: Array, time: float) -> Status:
        """Of a run in which a chord has turned too far."""
        owners = [(name, k) for name, count in frame.counts.items() for k in range(count)]
        body, element = owners[int(np.abs(turns).argmax())]
        why = f"element {element} of body {body!r} has turned by {np.abs(turns).max():.3g} rad; {HALF_TURN}"
        return Status("failed", why, time, None, body, element)


def analyse(job: dict[str, Any]) -> tuple[Array, Array, dict[str, Any]]:
    """Do a job of `Frame` in a process of its own, which may crash.

    Returns
    -------
    Times (s) or load factors, (n,); displacements along x and y (m) and rotations (rad), and of motions their rates,
    (n, 1 or 2, nodes, 3), as far as all are finite; steps done, processor and wall time of the steps, processor time of
    the whole process, s, and the trouble that ended it, empty without one.

    Raises
    ------
    UnsupportedError
        If OpenSees is not installed, or cannot be loaded.
    """
    with TemporaryDirectory(prefix="opensees-") as folder:
        ended = subprocess.run(
            [sys.executable, "-P", str(WORKER), folder],
            input=json.dumps(job), text=True, errors="replace", capture_output=True, env=os.environ | ONE_THREAD,
            check=False,
        )  # fmt: skip
        said = ended.stderr.strip().splitlines()[-1:]
        if "ImportError" in ended.stderr:
            raise not_installed(PACKAGES, said[0])
        rows, end_file = Path(folder, "rows"), Path(folder, "end.json")
        numbers = np.fromfile(rows) if rows.exists() else np.empty(0)
        end = json.loads(end_file.read_text()) if ended.returncode == 0 and end_file.exists() else None
    shape = (1 if job["static"] else 2, len(job["nodes"]), 3)
    width = 1 + int(np.prod(shape))
    table = numbers[: len(numbers) // width * width].reshape(-1, width)
    table = table[np.logical_and.accumulate(np.isfinite(table).all(axis=1))]
    if end is None:
        end = dict.fromkeys(("cpu", "wall", "whole"), float("nan")) | {"steps": max(len(table) - 1, 0)}
        why = f"the process of OpenSees was ended with exit code {ended.returncode}: {' '.join(said)}"
    else:
        why = "OpenSees' Newton iteration did not converge" if end["code"] else ""
    return table[:, 0], table[:, 1:].reshape(-1, *shape), end | {"trouble": why}


def _chords(frame: Frame, body: Beam, states: Array) -> tuple[Array, Array]:
    """Places of a body's nodes, (n, nodes, 2), and its rotations, (n, nodes)."""
    q = states[:, 0, np.array(frame.of_body[body.name]) - 1]
    return nodes_of(body, frame.counts[body.name])[0] + q[..., :2], q[..., 2]


def _chord_turns(frame: Frame, states: Array) -> Array:
    """Angles that all chords have turned by, (n, elements), rad; whole turns are those of the nodes' rotations."""
    found = []
    for body in frame.scene.beams:
        places, angles = _chords(frame, body, states)
        chords = np.diff(places, axis=1)
        seen = np.arctan2(chords[..., 1], chords[..., 0]) - body.angle
        mean = 0.5 * (angles[:, 1:] + angles[:, :-1])
        found.append(seen + 2.0 * np.pi * np.round((mean - seen) / (2.0 * np.pi)))
    return np.concatenate(found, axis=1)


def _field(frame: Frame, body: Beam, states: Array) -> InterpolatedField:
    """Axis through the nodes in their directions; its stretch at a node is that of the chords beside it."""
    places, angles = _chords(frame, body, states)
    chords = np.linalg.norm(np.diff(places, axis=1), axis=-1) / frame.element_length(body)
    stretch = np.empty(angles.shape)
    stretch[:, 0], stretch[:, -1] = chords[:, 0], chords[:, -1]
    stretch[:, 1:-1] = 0.5 * (chords[:, 1:] + chords[:, :-1])
    angle = body.angle + angles
    slope = stretch[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rates = None
    if states.shape[1] == 2:
        v = states[:, 1, np.array(frame.of_body[body.name]) - 1]
        turning = v[..., 2:] * np.stack([-slope[..., 1], slope[..., 0]], axis=-1)
        rates = np.stack([v[..., :2], turning], axis=2)
    return InterpolatedField(np.stack([places, slope], axis=2), body.length, rates)
