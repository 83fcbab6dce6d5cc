"""What joints and springs carry, and how many digits of it hold."""

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from anctmm.errors import ResultError, unknown_kind
from anctmm.model.case import Case
from anctmm.model.connectors import CONNECTORS, Connector, RotationalSpring, Spring
from anctmm.model.joints import JOINTS, Clamp, Joint, Pin, Prismatic, Slider, Weld
from anctmm.results.solution import Solution
from studies.engine.accuracy.digits import Value, probe_text


def at_joints(solution: Solution, case: Case) -> Iterator[tuple[Value, float]]:
    """For each joint its largest force and moment, for each spring its largest tension or moment, for a `Reading`.

    What a solver does not give, or equilibrium alone does not tell, is left out.
    """
    if not len(solution.t):
        return
    for joint in case.scene.joints:
        with suppress(ResultError):
            yield from _of_joint(solution, case, joint)
    for connector in case.scene.connectors:
        _, what, unit = _kind(connector)
        with suppress(ResultError):
            yield _largest(solution, case, connector_text(connector), what, unit, solution.tension(connector))


def joint_text(joint: Joint) -> str:
    """A joint in words."""
    return f"{type(joint).__name__.lower()} {', '.join(map(probe_text, joint.ends))}"


def connector_text(connector: Connector) -> str:
    """A connector in words."""
    return f"{_kind(connector)[0]} {', '.join(map(probe_text, connector.places))}"


def _kind(connector: Connector) -> tuple[str, str, str]:
    """Name of a connector's kind, of what it carries, and its unit."""
    match connector:
        case Spring():
            return "spring", "tension", "N"
        case RotationalSpring():
            return "rotational spring", "moment", "N m"
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)


def _of_joint(solution: Solution, case: Case, joint: Joint) -> Iterator[tuple[Value, float]]:
    reaction, name = solution.reaction(joint), joint_text(joint)
    yield _largest(solution, case, name, "force", "N", np.linalg.norm(reaction[:, :2], axis=1))
    match joint:
        case Clamp() | Weld():
            what = "moment" if joint.angle is None else "torque of the drive"
        case Prismatic():
            what = "moment"
        case Pin() | Slider():  # free to turn
            return
        case _:
            raise unknown_kind("joint", joint, JOINTS)
    yield _largest(solution, case, name, what, "N m", reaction[:, 2])


def _largest(
    solution: Solution, case: Case, name: str, what: str, unit: str, series: np.ndarray
) -> tuple[Value, float]:
    """The largest of a series over a motion, at rest its last, with the time and the size it is measured in."""
    k = len(series) - 1 if case.static else int(np.abs(series).argmax())
    when = "at rest" if case.static else f"at {solution.t[k]:.3g} s"
    quantity = f"{what} {when}" if case.static else f"largest {what}, {when}"
    return Value(name, quantity, unit, float(series[k])), float(np.abs(series).max())
