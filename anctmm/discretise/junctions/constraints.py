"""Constraints between kept unknowns, as sums of monomials: Σ c w(t) x_i x_j = 0.

All conditions of joints and bodies beyond linear maps have this form: |t|² = 1 of a rigid body, coincident points of
rigid bodies, a line in the ground or in a rigid body, a direction. Coefficients depend on time by signals w of the
drives: the cosine and the sine of an angle, or a position. One small kernel (`anctmm.recursion.kept.rows`) therefore
computes all values, time derivatives, the Jacobian J and its derivatives.

Vectors in the plane are complex numbers here, x + iy, linear in the unknowns.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.junctions.as_written import as_written, end_as_written
from anctmm.errors import UnsupportedError, shown, unknown_kind
from anctmm.model.drives import breaks_of
from anctmm.model.joints import Clamp, Motion, Prismatic, Slider, Weld, drive_of
from anctmm.model.places import End
from anctmm.model.scene import Scene
from anctmm.model.topology import Junction, end_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: The signal that is always 1, and what stands for 1 among the unknowns.
ALWAYS, ONE = 0, -1

Vector = dict[tuple[int, int], complex]
"""A vector of the plane by (signal, unknown or ONE)."""


class Term(NamedTuple):
    """factor · w_signal · x_one · x_two of a row; one of them may be ONE."""

    row: int
    one: int
    two: int
    signal: int
    factor: float


class Drive(NamedTuple):
    """What drives a joint: its name, its history, and whether that is an angle or a position."""

    name: str
    history: Motion
    turns: bool

    @property
    def signals(self) -> int:
        """Number of its signals: the cosine and the sine of an angle, or a position."""
        return 2 if self.turns else 1


@dataclass(frozen=True)
class Together:
    """The sum of two histories, or their difference, and their breaks if both state theirs."""

    one: Motion
    two: Motion
    sign: float = 1.0

    def __call__(self, t: Any) -> tuple[Any, ...]:
        """Value, rate and acceleration."""
        return tuple(
            np.add(a, np.multiply(self.sign, b)) for a, b in zip(self.one(t), self.two(t), strict=True)
        )

    @property
    def breaks(self) -> tuple[float, ...] | None:
        """Times at which one of them breaks, s."""
        found = [breaks_of("a drive", history) for history in (self.one, self.two)]
        return None if None in found else tuple(sorted({t for times in found for t in times or ()}))


@dataclass
class Constraints:
    """Constraints of a scene.

    Parameters
    ----------
    names : list of (str, str)
        Of each row: what it holds, for messages, and a body.
    terms : list of Term
    drives : list of Drive
        Signals are numbered from 1 on in their order.
    begins : list of int
        First rows of those that are eliminated together.
    prescribed : list of (int, int, complex)
        Rows that prescribe where nodes of beams are along a line in the ground, each node, and what a unit of the row
        is there, m. An explicit step sets these nodes, as it sets those of driven clamps.
    size : int
        Number of unknowns.
    """

    names: list[tuple[str, str]] = field(default_factory=list)
    terms: list[Term] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    begins: list[int] = field(default_factory=list)
    prescribed: list[tuple[int, int, complex]] = field(default_factory=list)
    size: int = 0

    @property
    def signals(self) -> int:
        """Number of signals, that which is always 1 included."""
        return 1 + sum(drive.signals for drive in self.drives)

    @property
    def pairs(self) -> Ints:
        """Pairs of unknowns that are coupled, multipliers numbered behind the coordinates, (2, pairs)."""
        found: list[tuple[int, int]] = []
        of_row: dict[int, set[int]] = {}
        for term in self.terms:
            used = [k for k in (term.one, term.two) if k != ONE]
            found += [(self.size + term.row, k) for k in used]
            of_row.setdefault(term.row, set()).update(used)
        for used_in_row in of_row.values():  # curvature, and J^T J in statics
            found += [(i, j) for i in used_in_row for j in used_in_row if i < j]
        return np.array(sorted(set(found)), dtype=np.int64).reshape(-1, 2).T

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which rows are linear in the unknowns and do not depend on time: pins, above all."""
        found = np.ones(len(self.names), dtype=bool)
        for term in self.terms:
            found[term.row] &= term.signal == ALWAYS and ONE in (term.one, term.two)
        return found

    @property
    def linear(self) -> Array:
        """J of those rows, which is constant, (rows, unknowns)."""
        found = np.zeros((len(self.names), self.size))
        still = self.still
        for term in self.terms:
            unknown = max(term.one, term.two)
            if still[term.row] and unknown != ONE:
                found[term.row, unknown] += term.factor
        return found[still]

    def add(self, what: str, body: str, *rows: Mapping[tuple[int, int, int], float]) -> None:
        """Add rows, each by (signal, one, two)."""
        self.begins.append(len(self.names))
        for row in rows:
            number = len(self.names)
            self.names.append((what, body))
            self.terms += [
                Term(number, one, two, signal, factor) for (signal, one, two), factor in row.items() if factor
            ]

    def driven(self, drive: Drive) -> int:
        """Number of the first signal of a drive, which is added if it is not yet among the drives."""
        if drive not in self.drives:
            self.drives.append(drive)
        before = self.drives[: self.drives.index(drive)]
        return 1 + sum(other.signals for other in before)


class Situated(Protocol):
    """The part of a chain that this module needs."""

    @property
    def parts(self) -> Scene:
        """The scene as it is passed."""
        ...

    @property
    def junctions(self) -> Sequence[Junction]:
        """Places where ends meet."""
        ...

    @property
    def bodies(self) -> Any:
        """Bodies as they are passed."""
        ...

    @property
    def rigid(self) -> Mapping[str, None]:
        """Names of the rigid bodies."""
        ...

    @property
    def guided(self) -> Sequence[Any]:
        """Places on lines in the ground that are eliminated like others."""
        ...

    @property
    def length(self) -> float:
        """Scale of positions, m."""
        ...


def shape_of(name: str) -> str:
    """What the constraint |t|² = 1 of a rigid body holds, in words."""
    return f"the shape of rigid body {name!r}"


def constraints_of(chain: Situated, of_end: Callable[[End], Any], size: int) -> Constraints:
    """Constraints of a scene between its kept unknowns, `size` of them.

    `of_end` gives the numbers of the place and of the gradients of an end at a kept vertex, and the vertex.
    """
    writer = _Writer(chain, of_end, Constraints(size=size))
    for name in chain.rigid:
        writer.unit(name)
    for junction in chain.junctions:
        writer.junction(junction)
    return writer.found


class _Writer:
    """Writes the constraints of a scene."""

    def __init__(self, chain: Situated, of_end: Callable[[End], Any], found: Constraints) -> None:
        self.chain, self.of_end, self.found = chain, of_end, found
        self.rigid = chain.rigid
        self.text = partial(end_as_written, chain.parts)
        self.scale = 1.0 / chain.length
        #: Ends on lines in the ground that are eliminated like others: no constraint is needed.
        self.passed = {end for guided in chain.guided for end in guided.ends}

    def unit(self, name: str) -> None:
        """|t|² = 1 of a rigid body."""
        _, t = self._unknowns(name)
        rows = {(ALWAYS, t, t): 0.5, (ALWAYS, t + 1, t + 1): 0.5, (ALWAYS, ONE, ONE): -0.5}
        self.found.add(shape_of(name), name, rows)

    def junction(self, junction: Junction) -> None:
        """All constraints of a junction."""
        bodies = [end for end in junction.ends if end[0] in self.rigid]
        if bodies and junction.grounded:
            for end in bodies:
                self._meet(end, self._position(end), self._reference(end))
        else:
            for end in bodies[1:]:
                self._meet(end, self._position(end), self._position(bodies[0]))
            others = [
                self.of_end(_passed(end)) for end in junction.ends if bodies and end[0] not in self.rigid
            ]
            for place in dict.fromkeys(found[0] for found in others if found and found[2].body is None):
                if place is not None:
                    self._meet(bodies[0], _vector(place), self._position(bodies[0]))
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            welded = [end for end in group if end[0] in self.rigid]
            for end in welded if clamp is not None else welded[1:]:
                self._parallel(end, clamp, None if clamp is not None else welded[0])
        for hinge in junction.hinges:
            self._hinge(hinge, junction)
        for guide in junction.guides:
            if _passed(end_of(self.chain.parts, guide.place)) not in self.passed:
                self._guide(guide, junction)

    def _meet(self, end: End, one: Vector, two: Vector) -> None:
        self.found.add(
            f"the joint at {self.text(end)}", end[0], *self._parts(_sum(one, two, -1.0), self.scale)
        )

    def _parallel(self, end: End, clamp: Clamp | None, other: End | None) -> None:
        """The direction of a rigid body is that of a clamp, or of another rigid body."""
        along: Vector = {(ALWAYS, ONE): 1.0} if other is None else self._direction(other)
        if clamp is not None:
            along = self._turned(along, clamp)
        self.found.add(f"the direction at {self.text(end)}", end[0], _across(along, self._direction(end)))

    def _hinge(self, hinge: Weld | Clamp, junction: Junction) -> None:
        """A direction is that of the first end, or of the ground, turned; of a driven weld so are all gradients."""
        first, *others = (self._carrier(end_of(self.chain.parts, place), junction) for place in hinge.ends)
        if isinstance(hinge, Clamp):
            row = _across(self._turned({(ALWAYS, ONE): 1.0}, hinge), self._axis(first, junction))
            self.found.add(f"the clamp of {self.text(first)}", first[0], row)
            return
        for second in others:
            if hinge.stretch == "held" and not {first[0], second[0]} <= set(self.rigid):
                self._turn_gradients(first, second, hinge, junction)
                continue
            clamp = None if second[0] in self.rigid else _clamp_of(second, junction)
            if hinge.angle is not None and clamp is not None and clamp.angle is not None:
                given = [shown(as_written(self.chain.parts, joint)) for joint in (hinge, clamp)]
                raise UnsupportedError(
                    f"{given[0]} turns what {given[1]} drives, and leaves its stretch free; name the driven end "
                    f"first, or hold the stretch"
                )
            one = self._further(self._axis(first, junction), hinge, first, junction)
            self.found.add(
                f"the weld at {self.text(second)}", second[0], _across(one, self._axis(second, junction))
            )

    def _axis(self, end: End, junction: Junction) -> Vector:
        """The vector that a torque turns there, as it has turned since the reference: r_x, r_y or t."""
        if end[0] in self.rigid:
            return self._direction(end)
        return self._gradient(end, self.chain.bodies.mesh(end[0]).kind.turning_row // 2, junction)

    def _turn_gradients(self, first: End, second: End, weld: Weld | None, junction: Junction) -> None:
        """The gradients of the second end are those of the first one, turned.

        A rigid body at gradients that are held has one condition: |t| = 1 is another one, and a third leaves the
        multipliers undetermined, and with them the work of the drive.
        """
        beam, other = (second, first) if second[0] not in self.rigid else (first, second)
        rows = []
        if other[0] in self.rigid and _known(self._axis(beam, junction)):
            rows.append(_across(*self._directions(first, second, weld, junction)))
        else:
            for k in range(1, self.chain.bodies.mesh(beam[0]).held // 2):
                one, two = self._gradient(first, k, junction), self._gradient(second, k, junction)
                rows += self._parts(_sum(two, self._further(one, weld, first, junction), -1.0), 1.0)
        name = "the driven weld" if weld is not None else "the direction"
        self.found.add(f"{name} at {self.text(second)}", second[0], *rows)

    def _directions(
        self, first: End, second: End, weld: Weld | None, junction: Junction
    ) -> tuple[Vector, Vector]:
        """Directions of a rigid body and of held gradients that are the same, the one or the other turned by a weld."""
        one, two = self._axis(first, junction), self._axis(second, junction)
        clamp = None if second[0] in self.rigid else _clamp_of(second, junction)
        if weld is None or clamp is None or clamp.angle is None or weld.angle is None:
            return self._further(one, weld, first, junction), two
        return one, self._by(self._both(clamp, weld, -1.0), {(ALWAYS, ONE): 1.0})  # drives do not multiply

    def _guide(self, guide: Slider | Prismatic, junction: Junction) -> None:
        """A place stays on a line, or moves on it as it is driven; a prismatic joint holds the direction, too."""
        end = end_of(self.chain.parts, guide.place)
        along = complex(*guide.direction)
        away = _sum(self._place(end, junction), self._origin(guide, end), -1.0)
        line: Vector = {(ALWAYS, ONE): along}
        if guide.body is not None:
            line = _times(self._direction((guide.body, 1)), along)
        rows = [_scaled(_across(line, away), self.scale)]
        if guide.position is not None:
            row = _scaled(_along(line, away), self.scale)
            signal = self.found.driven(self._drive(guide))
            row[signal, ONE, ONE] = -self.scale  # the line's direction has the length 1
            rows.append(row)
            if guide.body is None and not any(one[0] in self.rigid for one in junction.ends):
                number = len(self.found.names) + 1
                nodes = [self.chain.bodies.node(*one) for one in junction.ends]
                self.found.prescribed += [(number, node, along / self.scale) for node in nodes]
        self.found.add(f"the {type(guide).__name__.lower()} at {self.text(end)}", end[0], *rows)
        match guide:
            case Slider():
                pass
            case Prismatic(body=name):
                carrier = self._carrier(end, junction)
                if carrier[0] in self.rigid:
                    self._parallel(carrier, None, None if name is None else (name, 1))
                elif name is not None:  # gradients that the ground holds are no unknowns
                    self._turn_gradients((name, 1), end, None, junction)
            case _:
                raise unknown_kind("guide", guide, (Slider, Prismatic))

    def _carrier(self, end: End, junction: Junction) -> End:
        """The rigid body that an end is welded to, or itself."""
        group = next(group for group in junction.groups if end in group)
        return next((one for one in group if one[0] in self.rigid), end)

    def _origin(self, guide: Slider | Prismatic, end: End) -> Vector:
        """The point of the line where the place is in the reference."""
        reference = self.chain.parts.place(guide.place).position
        if guide.body is None:
            return {(ALWAYS, ONE): complex(*reference)}
        return self._point(guide.body, complex(*reference))

    def _unknowns(self, body: str) -> tuple[int, int]:
        place, _, _ = self.of_end((body, 1))
        return place, place + 2

    def _point(self, body: str, reference: complex) -> Vector:
        """A point that is fixed in a rigid body, by its place in the reference."""
        r, t = self._unknowns(body)
        q = self.chain.bodies.mesh(body).reference[0, 0]
        return _sum(_vector(r), _times(_vector(t), reference - complex(*q)), 1.0)

    def _position(self, end: End) -> Vector:
        return self._point(end[0], complex(*self.chain.parts.body(end[0]).position_at(end[1])))  # type: ignore[arg-type]

    def _reference(self, end: End) -> Vector:
        return {(ALWAYS, ONE): complex(*self.chain.parts.body(end[0]).position_at(end[1]))}  # type: ignore[arg-type]

    def _place(self, end: End, junction: Junction) -> Vector:
        """Where a junction is."""
        bodies = [one for one in junction.ends if one[0] in self.rigid]
        if junction.grounded:
            return self._reference(end)
        if bodies:
            return self._position(bodies[0])
        return _vector(self.of_end(_passed(end))[0])

    def _direction(self, end: End) -> Vector:
        """The unit vector t of a rigid body."""
        return _vector(self._unknowns(end[0])[1])

    def _gradient(self, end: End, k: int, junction: Junction) -> Vector:
        """How a gradient of an end has turned since the reference: r_x, or r_y of k = 2."""
        if end[0] in self.rigid:
            return self._direction(end)
        if (clamp := _clamp_of(end, junction)) is not None:
            return self._turned({(ALWAYS, ONE): 1.0}, clamp)
        _, gradients, vertex = self.of_end(_passed(end))
        if gradients is None:  # those that a prismatic joint holds
            return {(ALWAYS, ONE): 1.0}
        frame = next(g for g in vertex.welded if _passed(end) in g)[0]
        reference = self.chain.bodies.mesh(frame[0]).reference[0, k]
        return _times(_vector(gradients + 2 * k - 2), 1.0 / complex(*reference))

    def _further(self, vector: Vector, weld: Weld | None, end: End, junction: Junction) -> Vector:
        """The direction of an end, turned further by a weld; what a driven clamp holds by the sum of both angles."""
        if weld is None:
            return vector
        clamp = None if end[0] in self.rigid else _clamp_of(end, junction)
        if clamp is None or clamp.angle is None or weld.angle is None:
            return self._turned(vector, weld)
        return self._by(self._both(clamp, weld), {(ALWAYS, ONE): 1.0})

    def _both(self, clamp: Clamp, weld: Weld, sign: float = 1.0) -> Drive:
        """The sum of the angles of a driven clamp and of a driven weld, or their difference."""
        assert clamp.angle is not None  # the caller has checked that both are driven
        assert weld.angle is not None
        name = f"{self._drive(weld).name} beside {self._drive(clamp).name}"
        return Drive(name, Together(clamp.angle, weld.angle, sign), True)

    def _turned(self, vector: Vector, joint: Clamp | Weld) -> Vector:
        """A vector turned by the angle of a joint; itself where nothing drives it."""
        return vector if joint.angle is None else self._by(self._drive(joint), vector)

    def _by(self, drive: Drive, vector: Vector) -> Vector:
        """A vector turned by a drive."""
        signal = self.found.driven(drive)
        found: Vector = {}
        for (_, unknown), factor in vector.items():
            found[signal, unknown] = factor
            found[signal + 1, unknown] = 1j * factor
        return found

    def _drive(self, joint: Clamp | Weld | Slider | Prismatic) -> Drive:
        return drive_as_written(self.chain.parts, joint)

    def _parts(self, vector: Vector, scale: float) -> list[dict[tuple[int, int, int], float]]:
        """A vector's x and y as rows."""
        return [_scaled(_along({(ALWAYS, ONE): unit}, vector), scale) for unit in (1.0, 1.0j)]


def _known(vector: Vector) -> bool:
    """Whether no unknown is in a vector."""
    return all(unknown == ONE for _, unknown in vector)


def _clamp_of(end: End, junction: Junction) -> Clamp | None:
    """The clamp that holds the direction of an end."""
    return next(c for g, c in zip(junction.groups, junction.clamps, strict=True) if end in g)


def _passed(end: End) -> End:
    """An end as vertices name it: that of a point mass is its end 1."""
    return (end[0], 1) if end[1] == "center" else end


def drive_as_written(scene: Scene, joint: Clamp | Weld | Slider | Prismatic) -> Drive:
    """What drives a driven joint of a scene, of parts or not, named as the user wrote it."""
    found = drive_of(as_written(scene, joint))
    assert found is not None  # the caller has checked that it is driven
    return Drive(found[0], found[1], not joint.on_line)


def _vector(first: int) -> Vector:
    """The vector of two unknowns."""
    return {(ALWAYS, first): 1.0, (ALWAYS, first + 1): 1.0j}


def _sum(one: Vector, two: Vector, factor: complex) -> Vector:
    found = dict(one)
    for key, value in two.items():
        found[key] = found.get(key, 0.0) + factor * value
    return found


def _times(vector: Vector, factor: complex) -> Vector:
    return {key: factor * value for key, value in vector.items()}


def _products(one: Vector, two: Vector) -> Iterator[tuple[tuple[int, int, int], complex]]:
    """The terms of conj(one) · two, each by (signal, unknown, unknown)."""
    for (signal, i), a in one.items():
        for (other, j), b in two.items():
            assert ALWAYS in (signal, other)  # drives do not multiply
            yield (max(signal, other), min(i, j), max(i, j)), complex(a).conjugate() * b


def _along(line: Vector, vector: Vector) -> dict[tuple[int, int, int], float]:
    """The product of two vectors."""
    found: dict[tuple[int, int, int], float] = {}
    for key, value in _products(line, vector):
        found[key] = found.get(key, 0.0) + value.real
    return found


def _across(line: Vector, vector: Vector) -> dict[tuple[int, int, int], float]:
    """The cross product of two vectors."""
    found: dict[tuple[int, int, int], float] = {}
    for key, value in _products(line, vector):
        found[key] = found.get(key, 0.0) + value.imag
    return found


def _scaled(row: dict[tuple[int, int, int], float], factor: float) -> dict[tuple[int, int, int], float]:
    return {key: factor * value for key, value in row.items()}
