"""The solution from an analysis by OpenSees: fields, energies, and status."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import unknown_kind
from anctmm.model.drives import tabulate
from anctmm.model.loads import LOADS, Load, load_text, width_of
from anctmm.model.needs import not_offered
from anctmm.model.scene import Beam, Force, LineLoad, Torque
from anctmm.results.checks.divergence import checked
from anctmm.results.fields import InterpolatedField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from reference.opensees.frame import Frame
from reference.opensees.process import Analysis

Array = NDArray[np.float64]

#: Gauss points of the nonlinear beam on [0, 1]; each has half of the weight.
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
#: Part of half a turn above which a chord is reported as the reason of a failure.
NEAR = 0.85


def solution(name: str, frame: Frame, analysis: Analysis, build_s: float) -> Solution:
    """A solution as far as nothing speaks against it; `build_s` is the processor time spent on it here, s."""
    run, t, status = frame.run, analysis.t, Status()
    if not frame.static:
        t = run.times(run.output_steps)[: len(t)]
        analysis = _as_driven(frame, t, analysis)
    turns = _chord_turns(frame, analysis)
    if beyond := np.flatnonzero((np.abs(turns) > np.pi).any(axis=1)).tolist():
        kept, status = beyond[0], _too_far(frame, turns[beyond[0]], float(t[beyond[0]]))
    else:
        kept = len(t)
        if analysis.trouble:
            status = _failure(frame, analysis, turns)
    found = Solution(
        name,
        frame.scene,
        run,
        t,
        {body.name: _field(frame, body, analysis) for body in frame.scene.beams},
        _energy(frame, t, analysis),
        Cost(
            analysis.cpu,
            analysis.wall,
            analysis.steps,
            build_s=build_s + analysis.whole - analysis.cpu,
            compile_s=0.0,
        ),
        status,
        frame.dofs,
        static=frame.static,
    )
    if kept < len(t):
        found = found.until(kept, status)
    return checked(found, static=frame.static, energies=not (frame.driven or _varying(frame)))


def _as_driven(frame: Frame, t: Array, analysis: Analysis) -> Analysis:
    """The same with driven clamps at the angles of their drives, which OpenSees leaves where the step's balance was."""
    assert analysis.velocities is not None
    u, v = analysis.displacements.copy(), analysis.velocities.copy()
    for tag, name, drive in frame.driven:
        angles = tabulate(name, drive, t, 3)
        u[:, tag - 1, 2], v[:, tag - 1, 2] = angles[:, 0], angles[:, 1]
    return replace(analysis, displacements=u, velocities=v)


# --- how it ended --------------------------------------------------------------------------------------------


def _chord_turns(frame: Frame, analysis: Analysis) -> Array:
    """Angles that all chords have turned by, (n, elements), rad; whole turns are those of the nodes' rotations."""
    found = []
    for body in frame.scene.beams:
        q = analysis.displacements[:, np.array(frame.of_body[body.name]) - 1]
        chords = np.diff(frame.meshes[body.name].reference[:, 0] + q[..., :2], axis=1)
        seen = np.arctan2(chords[..., 1], chords[..., 0]) - body.angle
        mean = 0.5 * (q[:, 1:, 2] + q[:, :-1, 2])
        found.append(seen + 2.0 * np.pi * np.round((mean - seen) / (2.0 * np.pi)))
    return np.concatenate(found, axis=1)


def _place(frame: Frame, index: int) -> tuple[str, int]:
    """Body and element of a number that counts all elements."""
    for body in frame.scene.beams:
        if index < frame.meshes[body.name].elements:
            return body.name, index
        index -= frame.meshes[body.name].elements
    raise IndexError(index)


def _too_far(frame: Frame, turns: Array, time: float) -> Status:
    index = int(np.argmax(np.abs(turns)))
    body, element = _place(frame, index)
    why = (
        f"element {element} of body {body!r} has turned by {turns[index]:.3g} rad; OpenSees' frames, which turn with "
        f"their chords, know no more than half a turn from the start"
    )
    return Status("failed", why, time, body=body, element=element)


def _failure(frame: Frame, analysis: Analysis, turns: Array) -> Status:
    run = frame.run
    reached = float(analysis.t[-1]) if len(analysis.t) else 0.0
    if frame.static:
        where, advice = f"beyond load factor {reached:.6g}", "more load_steps may help, and hold every body"
        time, step = reached, None
    else:
        step = min(analysis.steps + 1, run.steps)
        time = float(run.times(np.array([step]))[0])
        where, advice = f"in step {step} (t = {time:.6g} s)", f"a dt below {run.dt:g} s may help"
    index = int(np.argmax(np.abs(turns[-1]))) if len(turns) else 0
    if len(turns) and abs(turns[-1, index]) > NEAR * np.pi:
        body, element = _place(frame, index)
        why = (
            f"element {element} of body {body!r} has turned by {turns[-1, index]:.3g} rad before; OpenSees' frames, "
            f"which turn with their chords, know no more than half a turn from the start"
        )
        return Status("failed", f"{analysis.trouble} {where}: {why}", time, step, body, element)
    return Status("failed", f"{analysis.trouble} {where}; {advice}", time, step)


# --- fields and energies -------------------------------------------------------------------------------------


def _field(frame: Frame, body: Beam, analysis: Analysis) -> InterpolatedField:
    """Axis through the nodes in their directions; its stretch at a node is that of the chords beside it."""
    tags = np.array(frame.of_body[body.name]) - 1
    q = analysis.displacements[:, tags]
    places = frame.meshes[body.name].reference[:, 0] + q[..., :2]
    chords = np.linalg.norm(np.diff(places, axis=1), axis=-1) / frame.element_length(body)
    stretch = np.empty(q.shape[:2])
    stretch[:, 0], stretch[:, -1] = chords[:, 0], chords[:, -1]
    stretch[:, 1:-1] = 0.5 * (chords[:, 1:] + chords[:, :-1])
    angle = body.angle + q[..., 2]
    slope = stretch[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rates = None
    if analysis.velocities is not None:
        v = analysis.velocities[:, tags]
        turning = np.stack([-slope[..., 1], slope[..., 0]], axis=-1) * v[..., 2:]
        rates = np.stack([v[..., :2], turning], axis=2)
    return InterpolatedField(np.stack([places, slope], axis=2), body.length, rates)


def _energy(frame: Frame, t: Array, analysis: Analysis) -> Energy:
    """Energies of the history; the work of drives is not known, that of histories is summed over the outputs."""
    u = analysis.displacements
    n = len(u)
    kinetic, strain, work = np.zeros(n), np.zeros(n), np.zeros(n)
    for body in frame.scene.beams:
        tags = np.array(frame.of_body[body.name]) - 1
        strain += _strain(frame, body, u[:, tags])
        if analysis.velocities is not None:
            v = analysis.velocities[:, tags]
            pairs = np.concatenate([v[:, :-1], v[:, 1:]], axis=2)
            kinetic += 0.5 * np.einsum("tei,ij,tej->t", pairs, frame.element_mass(body), pairs)
    potential = -np.einsum("tij,ij->t", u, frame.weights())
    for load in frame.scene.loads:
        one = u[:, frame.node(load) - 1]
        match load:
            case Force():
                moved = one[:, :2]
            case Torque():
                moved = one[:, 2:]
            case LineLoad():
                raise not_offered(load)
            case _:
                raise unknown_kind("load", load, LOADS)
        if isinstance(load, Force) and not callable(load.value):
            potential -= moved @ np.atleast_1d(load.value)
        elif not callable(load.value):
            work += moved @ np.atleast_1d(load.value)
        elif not frame.static:
            work += _work(load, t, moved)
    nan = np.full(n, np.nan)
    if frame.static:
        return Energy(kinetic, strain, nan, nan)
    return Energy(kinetic, strain, potential, nan if frame.driven else work)


def _strain(frame: Frame, body: Beam, u: Array) -> Array:
    """Strain energy of a body's elements, (n,), J, from the displacements of its nodes, (n, nodes, 3)."""
    l = frame.element_length(body)  # noqa: E741
    E, A, I = body.material.E, body.section.area, body.section.second_moment  # noqa: E741
    chords = np.diff(frame.meshes[body.name].reference[:, 0] + u[..., :2], axis=1)
    angle = np.arctan2(chords[..., 1], chords[..., 0]) - body.angle
    one, two = (_wrapped(theta - angle) for theta in (u[:, :-1, 2], u[:, 1:, 2]))
    stretch = np.linalg.norm(chords, axis=-1) / l - 1.0
    bending = 2.0 * E * I / l * (one * one + one * two + two * two)
    if frame.beam != "nonlinear":
        return (0.5 * E * A * l * stretch**2 + bending).sum(axis=1)  # type: ignore[no-any-return]
    axial = np.zeros_like(stretch)
    for x in GAUSS:
        slope = (1.0 - 4.0 * x + 3.0 * x * x) * one + (3.0 * x * x - 2.0 * x) * two
        axial += 0.5 * (stretch + 0.5 * slope * slope) ** 2
    return (0.5 * E * A * l * axial + bending).sum(axis=1)  # type: ignore[no-any-return]


def _wrapped(angle: Array) -> Array:
    """The same angle in [−π, π]."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi  # type: ignore[no-any-return]


def _varying(frame: Frame) -> list[Load]:
    return [load for load in frame.scene.loads if callable(load.value)]


def _work(load: Load, t: Array, moved: Array) -> Array:
    """∫ load · d(place) by the trapezoidal rule over the outputs, (n,), J."""
    values = tabulate(load_text(load), load.value, t, width_of(load))  # type: ignore[arg-type]
    work = np.zeros(len(t))
    mean = 0.5 * (values[1:] + values[:-1])
    work[1:] = np.cumsum((mean * np.diff(moved, axis=0)).sum(axis=1))
    return work
