"""Expressions of a joint's equations: sums over the coordinate vectors of a scene, in which joints are written.

A `Vector` is Σ w A x + Σ w b over coordinate vectors x, with constant matrices A and vectors b; a `Scalar` is the same
of products x·C y, c·x and numbers. w is 1 or a `Signal`, a factor that depends on time. From an expression
follow its values, rates, Jacobian and curvature; see `anctmm.system.rows`.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError, shown

Array = NDArray[np.float64]
#: Rotates a vector of the plane by +90°.
QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
QUARTER_TURN.setflags(write=False)


@dataclass(frozen=True)
class Signal:
    """A factor that depends on time: the value of a history, or the cosine or sine of it ("value", "cos", "sin").

    The history gives t (s) → value, rate and acceleration; `name` says what it drives, for messages.
    """

    history: Callable[[Any], tuple[Any, Any, Any]]
    shape: str = "value"
    name: str = "signal"

    def __mul__(self, other: "Any") -> "Any":
        if isinstance(other, Signal):
            raise PropertyError(
                f"{self.name}: two signals are multiplied; write one history of their product"
            )
        return other * self

    __rmul__ = __mul__

    def at(self, values: Array) -> Array:
        """Value, rate and acceleration, (3, n), from those of the history, (3, n)."""
        x, rate, acceleration = values
        if self.shape == "value":
            return np.array([x, rate, acceleration])
        c, s = np.cos(x), np.sin(x)
        if self.shape == "cos":
            return np.array([c, -s * rate, -s * acceleration - c * rate**2])
        return np.array([s, c * rate, c * acceleration - s * rate**2])


def signal(history: Callable[[Any], tuple[Any, Any, Any]], name: str = "signal") -> Signal:
    """A factor in a joint's equations that depends on time: t (s) → value, rate and acceleration.

    Raises
    ------
    PropertyError
        If the history cannot be called.
    """
    if not callable(history):
        raise PropertyError(f"{name} history is {shown(history)}; a callable t -> (x, x', x'') is needed")
    return Signal(history, "value", name)


Key = tuple[int, Signal | None]
Pair = tuple[int, int, Signal | None]


def _summed(terms: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Terms by their keys, those of one key added."""
    found: dict[Any, Any] = {}
    for key, value in terms:
        found[key] = found[key] + value if key in found else value
    return found


def _both(one: Signal | None, two: Signal | None) -> Signal | None:
    if one is not None and two is not None:
        raise PropertyError(f"{one.name} and {two.name} are multiplied; one signal in a product is allowed")
    return two if one is None else one


def _with_signal(key: Any, w: Signal) -> Any:
    """The key of a term that is multiplied by a signal, which stands last in it."""
    return (*key[:-1], _both(key[-1], w)) if isinstance(key, tuple) else _both(key, w)


def _initial(w: Signal | None) -> Array:
    value = 1.0 if w is None else w.at(np.array(w.history(0.0), dtype=float)[:, None])[0, 0]
    return np.full((1, 1), value)


class Linearised(NamedTuple):
    """An expression of m components for n values of its vectors.

    Its value, (n, m), derivatives by vectors, by their numbers, (n, m, dim), and what each signal is multiplied by,
    (n, m).
    """

    value: Array
    slopes: dict[int, Array]
    signals: dict[Signal, Array]


class _Expression:
    """Sums and multiples of expressions of one kind: each is a few mappings of keys to coefficients."""

    at: Array

    @property
    def _parts(self) -> tuple[Mapping[Any, Any], ...]:
        raise NotImplementedError

    def _like(self, other: Any) -> Any:
        """Another expression, or a constant as one of this kind."""
        raise NotImplementedError

    def _terms(self, x: Any) -> Iterator[tuple[Signal | None, Any, list[tuple[int, Array]]]]:
        """Signal, rest of the value, (n, m), and its derivatives by vectors of each term, for vectors (n, dim)."""
        raise NotImplementedError

    def linearised(self, x: Any = None, factor: Callable[[Signal | None], Array] = _initial) -> Linearised:
        """Value and derivatives for vectors x, each (n, dim), and factors of signals, (n, 1); default: at the start."""
        components = self.at.shape[1] if isinstance(self, Vector) else 1
        value, slopes, signals = factor(None) * np.zeros(components), dict[int, Any](), dict[Signal, Any]()
        for w, part, derivatives in self._terms(self.at[:, None] if x is None else x):
            value = value + factor(w) * part
            if w is not None:
                signals[w] = signals.get(w, 0.0) + part
            for v, slope in derivatives:
                slopes[v] = slopes.get(v, 0.0) + factor(w)[:, :, None] * slope
        return Linearised(value, slopes, {w: np.atleast_2d(part) for w, part in signals.items()})

    def _made(self, parts: Iterable[Mapping[Any, Any]]) -> Any:
        return type(self)(self.at, *parts)  # type: ignore[call-arg]

    def __add__(self, other: Any) -> Any:
        both = zip(self._parts, self._like(other)._parts, strict=True)
        return self._made(_summed([*a.items(), *b.items()]) for a, b in both)

    __radd__ = __add__

    def __neg__(self) -> Any:
        return self * -1.0

    def __sub__(self, other: Any) -> Any:
        return self + -self._like(other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, factor: Any) -> Any:
        if isinstance(factor, Signal):
            return self._made(
                {_with_signal(key, factor): v for key, v in part.items()} for part in self._parts
            )
        number = float(factor)
        return self._made({key: number * v for key, v in part.items()} for part in self._parts)

    __rmul__ = __mul__

    def __truediv__(self, factor: float) -> Any:
        return self * (1.0 / factor)


@dataclass(frozen=True)
class Vector(_Expression):
    """Σ w A x + Σ w b, over vectors x that are `at`, (vectors, dim), at the start.

    `terms`: A, (dim, dim), by number of x and signal w; None is the signal that is always 1. `constants`: b, (dim,).
    """

    at: Array
    terms: Mapping[Key, Array] = field(default_factory=dict)
    constants: Mapping[Signal | None, Array] = field(default_factory=dict)

    @property
    def start(self) -> Array:
        """Value at the start, (dim,)."""
        return self.linearised().value[0]

    @property
    def initial(self) -> "Vector":
        """The value at the start, as a vector that does not change."""
        return Vector(self.at, {}, {None: self.start})

    def mapped(self, matrix: Array) -> "Vector":
        """The vector multiplied by a constant matrix, (dim, dim)."""
        matrix = np.asarray(matrix, dtype=float)
        return Vector(
            self.at,
            {key: matrix @ A for key, A in self.terms.items()},
            {w: matrix @ b for w, b in self.constants.items()},
        )

    @property
    def normal(self) -> "Vector":
        """In the plane the vector rotated by +90°."""
        if self.at.shape[1] != 2:
            raise PropertyError("a vector of space has no normal; `mapped` takes a matrix")
        return self.mapped(QUARTER_TURN)

    def __matmul__(self, other: Any) -> "Scalar":
        """The dot product."""
        two = self._like(other)
        one_x, one_b, two_x, two_b = (part.items() for part in (*self._parts, *two._parts))
        pairs = (((x, y, _both(w, u)), A.T @ B) for (x, w), A in one_x for (y, u), B in two_x)
        terms = [((x, _both(w, u)), A.T @ b) for (x, w), A in one_x for u, b in two_b]
        terms += [((y, _both(w, u)), B.T @ a) for w, a in one_b for (y, u), B in two_x]
        constants = ((_both(w, u), float(a @ b)) for w, a in one_b for u, b in two_b)
        return Scalar(self.at, _summed(pairs), _summed(terms), _summed(constants))

    __rmatmul__ = __matmul__

    def components(self) -> list["Scalar"]:
        """The components, one by one."""
        return [self @ axis for axis in np.eye(self.at.shape[1])]

    @property
    def _parts(self) -> tuple[Mapping[Any, Any], ...]:
        return self.terms, self.constants

    def _terms(self, x: Any) -> Iterator[tuple[Signal | None, Any, list[tuple[int, Array]]]]:
        yield from ((w, x[v] @ A.T, [(v, A)]) for (v, w), A in self.terms.items())
        yield from ((w, b, []) for w, b in self.constants.items())

    def _like(self, other: Any) -> "Vector":
        if isinstance(other, Vector):
            return other
        return Vector(self.at, {}, {None: _constant(other, self.at.shape[1])})


@dataclass(frozen=True)
class Scalar(_Expression):
    """Σ w x·C y + Σ w c·x + Σ w n: one equation of a joint says that it is zero.

    `pairs`: C, (dim, dim), by numbers of x and y and signal w; `terms`: c, (dim,), by number of x and w; `constants`:
    n; `at` as of `Vector`.
    """

    at: Array
    pairs: Mapping[Pair, Array] = field(default_factory=dict)
    terms: Mapping[Key, Array] = field(default_factory=dict)
    constants: Mapping[Signal | None, float] = field(default_factory=dict)

    @property
    def start(self) -> float:
        """Value at the start."""
        return float(self.linearised().value[0, 0])

    @property
    def _parts(self) -> tuple[Mapping[Any, Any], ...]:
        return self.pairs, self.terms, self.constants

    def _terms(self, x: Any) -> Iterator[tuple[Signal | None, Any, list[tuple[int, Array]]]]:
        for (i, j, w), C in self.pairs.items():
            left, right = x[j] @ C.T, x[i] @ C
            yield w, (x[i] * left).sum(axis=1)[:, None], [(i, left[:, None]), (j, right[:, None])]
        yield from ((w, (x[v] @ c)[:, None], [(v, c)]) for (v, w), c in self.terms.items())
        yield from ((w, np.full(1, n), []) for w, n in self.constants.items())

    def _like(self, other: Any) -> "Scalar":
        if isinstance(other, Scalar):
            return other
        known = isinstance(other, Signal)
        return Scalar(self.at, {}, {}, {other if known else None: 1.0 if known else float(other)})


def _constant(value: Any, dim: int) -> Array:
    found = np.asarray(value, dtype=float)
    if found.shape != (dim,):
        raise PropertyError(f"{shown(value)} stands beside a vector; {dim} numbers are needed")
    return found
