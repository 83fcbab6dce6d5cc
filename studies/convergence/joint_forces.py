"""Forces of joints and springs, and how many of their digits are correct."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from anctmm.errors import ResultError, unknown_kind
from anctmm.model.case import Case
from anctmm.model.connectors import CONNECTORS, Connector, RotationalSpring, Spring
from anctmm.model.joints import JOINTS, Clamp, Joint, Pin, Prismatic, Slider, Weld
from anctmm.model.places import Written
from anctmm.results.solution import Solution
from studies.engine.accuracy.digits import ROUNDING, Value, largest_of
from studies.engine.place_texts import place_texts


def at_joints(solution: Solution, case: Case) -> Iterator[tuple[Value, float]]:
    """For each joint its largest force and moment, for each spring its largest tension or moment, for a `Reading`.

    What a solver does not give, or equilibrium alone does not tell, is left out.
    """
    if not len(solution.t):
        return
    every = list(_series(solution, case))
    force, moment = (max((s.size for s in every if s.unit == unit), default=0.0) for unit in ("N", "N m"))
    least = {"N": ROUNDING * force, "N m": ROUNDING * max(moment, force * case.scene.length)}
    for series in every:
        yield series.largest(solution, case, least[series.unit]), series.size


def _kind(connector: Connector) -> tuple[str, str, str]:
    """Name of a connector's kind, of what it carries, and its unit."""
    match connector:
        case Spring():
            return "spring", "tension", "N"
        case RotationalSpring():
            return "rotational spring", "moment", "N m"
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)


@dataclass(frozen=True)
class _Series:
    """What a joint or a connector carries at each output, in N or N m."""

    name: str
    what: str
    unit: str
    values: np.ndarray

    @property
    def size(self) -> float:
        return float(np.abs(self.values).max())

    def largest(self, solution: Solution, case: Case, least: float) -> Value:
        """The largest at the outputs of a motion, at rest the last, with the time."""
        k = len(self.values) - 1 if case.static else int(np.abs(self.values).argmax())
        when = "at rest" if case.static else f"at {solution.t[k]:.3g} s"
        quantity = f"{self.what} {when}" if case.static else f"{largest_of(self.what, case)}, {when}"
        return Value(self.name, quantity, self.unit, float(self.values[k]), least)


def _series(solution: Solution, case: Case) -> Iterator[_Series]:
    scene = case.scene
    texts = place_texts(
        [*(p for j in scene.joints for p in j.ends), *(p for c in scene.connectors for p in c.places)]
    )

    def name_of(kind: str, places: Iterable[Written]) -> str:
        return f"{kind} {', '.join(texts[place] for place in places)}"

    for joint in scene.joints:
        with suppress(ResultError):
            reaction, name = solution.reaction(joint), name_of(type(joint).__name__.lower(), joint.ends)
            yield _Series(name, "force", "N", np.linalg.norm(reaction[:, :2], axis=1))
            if what := _moment_of(joint):
                yield _Series(name, what, "N m", reaction[:, 2])
    for connector in scene.connectors:
        kind, what, unit = _kind(connector)
        with suppress(ResultError):
            yield _Series(name_of(kind, connector.places), what, unit, solution.tension(connector))


def _moment_of(joint: Joint) -> str:
    """What a joint's moment is called; nothing where it is free to turn."""
    match joint:
        case Clamp() | Weld():
            return "moment" if joint.angle is None else "torque of the drive"
        case Prismatic():
            return "moment"
        case Pin() | Slider():
            return ""
        case _:
            raise unknown_kind("joint", joint, JOINTS)
