"""Summary of a case for the results page: how many digits are correct, and the forces in its joints."""

from collections.abc import Iterable, Sequence
from math import isfinite

from studies.convergence.joint_forces import at_joints
from studies.engine.accuracy.digits import Value, values_of
from studies.engine.accuracy.refinement import Refined
from studies.engine.answers import Answer


def answers(found: Iterable[Refined]) -> tuple[Answer, ...]:
    """Of each case, by the first of its elements: what to run for its digits, and its largest force."""
    first = {refined.levels.case.name: refined for refined in reversed(list(found))}
    return tuple(answer for refined in reversed(first.values()) for answer in _of(refined))


def _of(found: Refined) -> list[Answer]:
    name = found.levels.case.name
    if not found.solution.status.ok:
        return [Answer(f"{name}: how many digits are correct?", "none", f"{found.reason}.")]
    values = values_of(found)
    moved = [v for v in values if v.quantity.startswith("largest displacement")] or values
    told = [_digits(found, max(moved, key=lambda v: abs(v.value)))]
    forces = [v for v in values_of(found, at_joints) if v.unit == "N" and not v.probe.startswith("spring")]
    return [*told, _force(name, forces)] if any(v.value for v in forces) else told


def _digits(found: Refined, value: Value) -> Answer:
    parts = [f"mesh {found.mesh.error:.1g}"] if found.levels.refines_mesh else []
    parts += [f"step {found.step.error:.1g}"] if found.levels.refines_step else []
    trial = found.trial
    step = "at rest" if found.levels.case.static else f"{trial.integrator}, Δt = {1e3 * trial.dt:.3g} ms"
    beams = f", {trial.cut} {trial.element} elements" if trial.scene.beams else ""
    run = f"{trial.solver}{beams}, {step}"
    known = f"{_held(value)}{value.probe}, {value.quantity}. By {run}: "
    error = (
        f"estimated error {found.error:.1g} ({', '.join(parts)})"
        if parts
        else "there is no mesh or step to refine"
    )
    short = "" if found.reached else f"; above the target {found.target:g}, as {found.reason}"
    return Answer(
        f"{found.levels.case.name}: how many digits are correct?", value.text, f"{known}{error}{short}."
    )


def _held(value: Value) -> str:
    """How many digits of a value are correct, in words."""
    match value.digits:
        case None:
            return ""
        case 0:
            return "No digit is correct. "
        case 1:
            return "Its first digit is correct. "
        case count:
            return f"Its first {count} digits are correct. "


def _force(name: str, forces: Sequence[Value]) -> Answer:
    worst = max(forces, key=lambda v: abs(v.value))
    sure = isfinite(worst.uncertainty) and worst.uncertainty < 0.1 * abs(worst.value)
    doubt = "" if sure else " Only its order of magnitude is known: a smaller --error refines it."
    take = f"{_held(worst)}In {worst.probe}, {worst.quantity.removeprefix('largest force ')}.{doubt}"
    return Answer(f"{name}: what is the largest force in a joint?", worst.text, take)
