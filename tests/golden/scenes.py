"""Bodies, histories and readings that the groups share; every place has a value of its own."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers
from tests.golden.vary import Point

STRIP, ROD, BLOCK = at.Rectangle(0.02, 0.02), at.Circle(0.03), at.Rectangle(0.01, 0.03)
SOFT = at.Material(E=2e5, density=1000.0, poisson=0.3)
FIRM = at.Material(E=5e5, density=1300.0, poisson=0.2)
PLAIN = at.Material(E=3e5, density=900.0)
STEEL = at.Material(E=2.1e11, density=7850.0)
A, B, C, D, E = (0.0, 0.0), (0.4, 0.1), (0.7, 0.4), (1.1, 0.3), (1.5, 0.6)
GRAVITY = (7.0, -11.0)
#: Steps of the small scenes: explicit and implicit ones.
ZHAI: dict[str, Any] = {"integrator": "zhai", "dt": 4e-4, "t_end": 0.024, "output_dt": 0.012}
ALPHA: dict[str, Any] = {"dt": 2e-3, "t_end": 0.048, "output_dt": 0.024}
ESDIRK: dict[str, Any] = {"integrator": "esdirk", "dt": 2e-3, "t_end": 0.048, "output_dt": 0.024}


@dataclass(frozen=True)
class Ramp:
    """A force that grows and turns, N."""

    first: Point
    rate: Point

    def __call__(self, t: Any) -> tuple[Any, Any]:
        """Force at the time(s) t (s)."""
        return self.first[0] + self.rate[0] * t, self.first[1] + self.rate[1] * t * t


@dataclass(frozen=True)
class Parabola:
    """Value, rate and, unless short, acceleration of a history a t + b t² beside a first value."""

    rate: float
    growth: float = 0.0
    first: float = 0.0
    short: bool = False

    def __call__(self, t: Any) -> tuple[Any, ...]:
        """As the drive of a joint; if short as the free length or angle of a connector."""
        value, rate = self.first + self.rate * t + self.growth * t * t, self.rate + 2.0 * self.growth * t
        return (value, rate) if self.short else (value, rate, 2.0 * self.growth + 0.0 * t)


def beam(
    name: str,
    start: Point,
    end: Point,
    material: at.Material = SOFT,
    section: at.Section = STRIP,
    **more: Any,
) -> at.Beam:
    """A beam, at rest unless it is given a velocity."""
    return at.Beam(name, start, end, section, material, **more)


def turning(body: at.Beam, center: Point, spin: float, velocity: Point = (0.0, 0.0)) -> at.Beam:
    """The beam with the initial velocity of a rigid motion."""
    return replace(body, velocity=at.RigidVelocity(body.start, body.end, center, spin, velocity))


def scene(
    name: str,
    bodies: Iterable[Any],
    joints: Iterable[Any] = (),
    loads: Iterable[Any] = (),
    connectors: Iterable[Any] = (),
    gravity: Point = GRAVITY,
) -> at.Scene:
    """A scene with gravity."""
    return at.Scene(name, tuple(bodies), tuple(joints), tuple(loads), gravity, tuple(connectors))


def motion_of(s: at.Solution, *places: Any, angles: Iterable[Any] = ()) -> Answers:
    """Displacements, velocities, angles and energies of a motion at its outputs; positions do not depend on a shift."""
    found: Answers = {
        "status": s.status.code,
        "displacement": np.stack([s.displacement(p)[1:] for p in places]),
        "velocity": np.stack([s.velocity(p)[1:] for p in places]),
        "energy": np.stack([s.energy.kinetic, s.energy.strain, s.energy.potential])[:, 1:],
    }
    for place in angles:
        found["angle"] = s.angle(place)[1:]
        found["spin"] = s.spin(place)[1:]
    return found


def work_of(s: at.Solution) -> Answers:
    """Work of drives, torques and what varies in time, a sum over the steps that may be taken by several rules."""
    scale = float(np.nanmax([s.energy.kinetic, s.energy.strain, np.abs(s.energy.work)]))
    return {"work": Answer(s.energy.work[1:], scale, coarse=True)}


def reaction_of(s: at.Solution, *joints: Any) -> Answers:
    """Forces and moments of joints."""
    kind = "reaction of {} {}"
    return {
        key: answer
        for joint in joints
        for key, answer in _forces(
            s, kind.format(type(joint).__name__.lower(), ", ".join(map(str, joint.ends))), s.reaction(joint)
        )
    }


def section_of(s: at.Solution, *places: Any) -> Answers:
    """Section forces at places."""
    return {
        key: answer
        for place in places
        for key, answer in _forces(s, f"section {place}", s.section_force(place))
    }


def _forces(s: at.Solution, name: str, values: Any) -> Iterable[tuple[str, Answer]]:
    """Forces, and moments beside arms of 0.1 m; implicit methods read the accelerations for them in several ways."""
    scale, coarse = float(np.abs(values[:, :2]).max()), not _explicit(s)
    yield f"{name}, force", Answer(values[:, :2], scale, coarse=coarse)
    yield f"{name}, moment", Answer(values[:, 2], 0.1 * scale, coarse=coarse)


def _explicit(s: at.Solution) -> bool:
    """Whether accelerations at outputs are those of the equations of motion (also of statics, which have none)."""
    return s.static or s.run is None or s.run.explicit


def under(kind: str, answers: Answers) -> Answers:
    """Answers of one of several runs of a group."""
    return {f"{kind}, {name}": answer for name, answer in answers.items()}
