"""Histories as piecewise polynomials of controlled error, for kernels that choose their own steps.

Loads and drives are Python callables, which compiled steps cannot call. Before the run each is therefore replaced by
Chebyshev interpolants on pieces that are halved until they agree with the callable, at additional points and at samples
over the whole run. Where no piece agrees there is a jump; halving finds its position to round-off, and pieces end
there. (Battles & Trefethen 2004, DOI 10.1137/S1064827503430126; jumps after Pachon, Platte & Trefethen 2010,
DOI 10.1093/imanum/drp008.)

Guaranteed: a change that lasts 1e-4 of the run is detected (1e-3 of it if breaks are stated), because the samples are
that dense; changes between stated breaks that are closer together are detected as well.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from anctmm.errors import PropertyError
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined
from anctmm.model.drives import Pulse, Quintic, breaks_of, tabulate

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Coefficients of a piece; pieces of a history, and those halved at once, at most.
TERMS, MOST, AT_ONCE = 9, 2**17, 2**16
#: Samples over the run, of histories without and with stated breaks, and the pieces that the search starts from.
SAMPLES, SAMPLES_BESIDE_BREAKS, PIECES = 2**15, 2**12, 64
#: Samples evaluated twice: a random history gives other values.
AGAIN = 8
#: Part of the run within which two breaks, or a break and an output, are one.
SHORTEST = 1e-9
#: Width of a piece, in parts of the run, at which what it does not represent is a jump.
POINT = 2.0**-46
#: Error of the pieces, of the largest value of a history: anywhere, and as a mean over the run where it is a kink.
SUP, MEAN = 1e-9, 1e-10
#: The same for the angle of a drive, whose second difference over a step is its acceleration.
SUP_ANGLE = 1e-12
#: A kink's error falls to this part or less at each halving, on the average of some; a jump's does not.
FALLS, SOME = 0.75, 8
#: Parts of the largest value by which a history jumps if the motion is to restart, and by which a drive must not jump.
JUMP, TORN = 1e-6, 1e-6
#: Part of the largest rate up to which the rates of a drive may differ from the derivatives of its angle.
CONSISTENT = 1e-3

#: Errors by which two pieces may differ where they meet, and the part of a piece at its ends that nothing looks at.
APART, BLIND = 1e5, 2e-3

_NODES = np.cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS)
_TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_NODES, TERMS - 1))
_CHECKS = np.array([-0.9983, -0.937, -0.52, -0.173, 0.168, 0.51, 0.941, 0.9991])
_AT_CHECKS = chebyshev.chebvander(_CHECKS, TERMS - 1)


@by_address
class Pieces(NamedTuple):
    """Histories for kernels.

    Parameters
    ----------
    first : ndarray of int, shape (histories + 1,)
        Place of the first piece of each history.
    edges : ndarray, shape (2, pieces)
        Start and end of each piece, s.
    terms : ndarray, shape (pieces, 3, TERMS)
        Chebyshev coefficients of the values of a history, those that it does not have zero.
    steady : ndarray of bool, shape (histories,)
        Whether a history never changes.
    """

    first: Ints
    edges: Array
    terms: Array
    steady: NDArray[np.bool_]


@dataclass(frozen=True)
class Represented:
    """One history in pieces.

    Parameters
    ----------
    edges : ndarray, shape (n + 1,)
    terms : ndarray, shape (n, width, TERMS)
    breaks : ndarray, shape (k,)
        Times within the run at which it, or a derivative, jumps, s.
    scale : ndarray, shape (width,)
        Largest sizes of its values.
    """

    edges: Array
    terms: Array
    breaks: Array
    scale: Array

    def jumps(self) -> Array:
        """By how much the values jump at each break, of their scale, (k, width)."""
        after = np.searchsorted(self.edges, self.breaks)
        ends = self.terms[after - 1].sum(axis=-1)
        starts = (self.terms[after] * (-1.0) ** np.arange(TERMS)).sum(axis=-1)
        return np.abs(starts - ends) / np.where(self.scale > 0.0, self.scale, 1.0)  # type: ignore[no-any-return]


class Calendar:
    """Times at which steps must end: outputs, and the breaks of all histories, no two closer than steps can be.

    Parameters
    ----------
    t_end : float
        s.
    outputs : ndarray
        Times of the outputs from 0 to `t_end`, s, ascending.
    """

    def __init__(self, t_end: float, outputs: Array) -> None:
        self.t_end, self.outputs = t_end, outputs
        #: Ascending.
        self.breaks: list[float] = []

    def snap(self, t: float) -> float:
        """The output or known break that this time means; it becomes a known break itself if there is none."""
        shortest = SHORTEST * self.t_end
        place = int(np.searchsorted(self.outputs, t))
        for near in self.outputs[max(place - 1, 0) : place + 1]:
            if abs(t - near) <= shortest:
                return float(near)
        place = bisect_left(self.breaks, t)
        for known in self.breaks[max(place - 1, 0) : place + 1]:
            if abs(t - known) <= shortest:
                return known
        self.breaks.insert(place, t)
        return t

    def all_of(self, name: str, times: tuple[float, ...]) -> Array:
        """Stated breaks within the run, snapped."""
        inside = [t for t in times if SHORTEST * self.t_end < t < (1.0 - SHORTEST) * self.t_end]
        for one, two in pairwise(inside):
            if two - one <= 2.0 * SHORTEST * self.t_end:
                raise PropertyError(
                    f"{name}: its breaks at {one!r} and {two!r} s are {two - one:.3g} s apart; more than "
                    f"{2.0 * SHORTEST * self.t_end:.3g} s is needed in a run of {self.t_end:g} s with a tolerance"
                )
        return np.array([self.snap(t) for t in inside])


def represent(name: str, history: Callable[[Any], Any], width: int, calendar: Calendar) -> Represented:
    """A history as polynomials on pieces.

    Parameters
    ----------
    name : str
        What the history drives, for messages.
    history : callable
        t (s) → one value (`width` 1) or a sequence of `width` values; three are those of a drive.
    calendar : Calendar
        Of the run; learns the breaks.

    Raises
    ------
    PropertyError
        If the history gives no finite numbers, varies too fast to be followed, or is a drive that jumps.
    """
    stated = breaks_of(name, history)
    breaks = calendar.all_of(name, stated or ())
    search = _Search(name, history, width, calendar.t_end, stated is not None)
    while True:
        edges, terms, found = search.pieces(breaks)
        new = np.array([calendar.snap(t) for t in found])
        new = new[(new > 0.0) & (new < calendar.t_end) & ~np.isin(new, breaks)]
        if not new.size:
            return Represented(edges, terms, breaks, search.scale)
        breaks = np.unique(np.concatenate([breaks, new]))


class _Search:
    """Samples of a history, and pieces that agree with them."""

    def __init__(
        self, name: str, history: Callable[[Any], Any], width: int, t_end: float, stated: bool
    ) -> None:
        self.name, self.history, self.width, self.t_end = name, history, width, t_end
        count = SAMPLES_BESIDE_BREAKS if stated else SAMPLES
        if isinstance(history, Quintic | Pulse):  # known between their breaks
            count = 2 * PIECES
        # one sample in each of equal cells, at places that no period shares
        self.t = t_end * (np.arange(count) + np.arange(count) * 0.6180339887498949 % 1.0) / count
        self.values = tabulate(name, history, self.t, width)
        again = tabulate(name, history, self.t[:AGAIN], width)
        if not np.array_equal(again, self.values[:AGAIN]):
            raise PropertyError(
                f"{name}: the history gave {self.values[0].tolist()!r} at t = {float(self.t[0])!r} s, and at a second "
                f"call {again[0].tolist()!r}; one value at each time is needed"
            )
        self.scale = np.abs(self.values).max(axis=0)
        if width == 2:  # the parts of one force
            self.scale[:] = self.scale.max()

    def pieces(self, breaks: Array) -> tuple[Array, Array, list[float]]:
        """Edges, terms and jumps that were found, for pieces that end at the breaks."""
        edges = np.concatenate([[0.0], breaks, [self.t_end]])
        parts = np.maximum(1, np.round(PIECES * np.diff(edges) / self.t_end)).astype(int)
        cut = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(edges, edges[1:], parts, strict=False)]
        a = np.concatenate(cut)
        b = np.append(a[1:], self.t_end)
        most, halvings = np.zeros(len(a)), 0
        starts: list[Array] = []
        terms: list[Array] = []
        jumps: list[float] = []
        while len(a):
            if len(a) > AT_ONCE or len(a) + sum(map(len, starts)) > MOST:
                self._give_up(a, b)
            found, error = self._fit(a, b)
            good = error <= 1.0
            narrow = ~good & (b - a <= POINT * self.t_end)
            jumps += list(0.5 * (a + b)[narrow])
            most = np.maximum(most, error)
            done = good | narrow
            if self.width < 3 and halvings >= SOME:  # a kink whose error counts for nothing over the run
                small = error * SUP * (b - a) <= MEAN * self.t_end / PIECES
                done |= small & (error <= most * FALLS**halvings)
            starts.append(a[done])
            terms.append(found[done])
            a, b, most, halvings = a[~done], b[~done], np.repeat(most[~done], 2), halvings + 1
            middle = 0.5 * (a + b)
            a, b = np.stack([a, middle], axis=1).ravel(), np.stack([middle, b], axis=1).ravel()
        start, found = np.concatenate(starts), np.concatenate(terms)
        order = np.argsort(start)
        edges, found = np.append(start[order], self.t_end), found[order]
        return edges, found, jumps or self._between(edges, found, breaks)

    def _between(self, edges: Array, terms: Array, breaks: Array) -> list[float]:
        """Jumps so close to the ends of pieces that neither piece has seen them: there the pieces do not meet."""
        inner = np.flatnonzero(~np.isin(edges[1:-1], breaks))
        left, right = terms[inner], terms[inner + 1]
        value = left.sum(axis=2), (right * (-1.0) ** np.arange(TERMS)).sum(axis=2)
        apart = (np.abs(value[0] - value[1]) > APART * self._allowed()).any(axis=1)
        inner, before, after = inner[apart], value[0][apart], value[1][apart]
        width = np.diff(edges)
        low, high = edges[inner + 1] - BLIND * width[inner], edges[inner + 1] + BLIND * width[inner + 1]
        while len(low) and (high - low).max() > POINT * self.t_end:
            middle = 0.5 * (low + high)
            here = tabulate(self.name, self.history, middle, self.width)
            gone = np.abs(here - after).max(axis=1) < np.abs(here - before).max(axis=1)
            low, high = np.where(gone, low, middle), np.where(gone, middle, high)
        return list(0.5 * (low + high))

    def _fit(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Coefficients on pieces, (n, width, TERMS), and the largest error of each, of what is allowed, (n,)."""
        middle, half = 0.5 * (a + b), 0.5 * (b - a)
        inside = np.concatenate([_NODES, _CHECKS])
        t = (middle[:, None] + half[:, None] * inside).ravel()
        values = tabulate(self.name, self.history, t, self.width).reshape(len(a), -1, self.width)
        self.scale = np.maximum(self.scale, np.abs(values).max(axis=(0, 1)))
        allowed = self._allowed()
        terms = np.einsum("kj,njw->nwk", _TO_COEFFICIENTS, values[:, :TERMS])
        misses = np.einsum("ck,nwk->ncw", _AT_CHECKS, terms) - values[:, TERMS:]
        error = (np.abs(misses) / allowed).max(axis=(1, 2))
        low, high = np.searchsorted(self.t, a), np.searchsorted(self.t, b)
        piece = np.repeat(np.arange(len(a)), high - low)
        known = np.arange(len(piece)) + np.repeat(high - np.cumsum(high - low), high - low)
        x = (self.t[known] - middle[piece]) / half[piece]
        here = np.einsum("sk,swk->sw", chebyshev.chebvander(x, TERMS - 1), terms[piece])
        np.maximum.at(error, piece, (np.abs(here - self.values[known]) / allowed).max(axis=1))
        return terms, error

    def _allowed(self) -> Array:
        allowed = SUP * self.scale
        if self.width == 3:
            allowed[0] = SUP_ANGLE * self.scale[0]
        return np.where(allowed > 0.0, allowed, np.finfo(float).tiny)

    def _give_up(self, a: Array, b: Array) -> None:
        narrowest = int(np.argmin(b - a))
        raise PropertyError(
            f"{self.name}: the history varies too fast to be followed in a run of {self.t_end:g} s with a tolerance, "
            f"as at t = {float(a[narrowest]):.6g} s ({MOST} polynomials are not enough); a smoother history or a fixed "
            f"dt is needed"
        )


def check_drive(name: str, drive: Represented) -> None:
    """Refuse a drive whose angle or rate jumps, or whose rates are not the derivatives of its angle.

    Raises
    ------
    PropertyError
    """
    jumps = drive.jumps()[:, :2]
    for k, what in enumerate(("angle", "rate")):
        torn = np.flatnonzero(jumps[:, k] > TORN)
        if torn.size:
            raise PropertyError(
                f"{name}: its {what} jumps at t = {float(drive.breaks[torn[0]]):.6g} s; with a tolerance a continuous "
                f"{what} is needed, because a jump needs an infinite moment"
            )
    half = 0.5 * np.diff(drive.edges)
    wide = np.flatnonzero(half > 1e-6 * drive.edges[-1])
    for k, what in enumerate(("rate", "acceleration")):
        slope = chebyshev.chebder(drive.terms[wide, k], axis=1) / half[wide, None]
        misfit = np.abs(slope.sum(axis=1) - drive.terms[wide, k + 1].sum(axis=1))
        noise = SUP_ANGLE * TERMS**2 * drive.scale[k] / half[wide]
        bad = np.flatnonzero(misfit > CONSISTENT * drive.scale[k + 1] + noise)
        if bad.size:
            t = float(drive.edges[wide[bad[0]] + 1])
            raise PropertyError(
                f"{name}: its {what} differs by {misfit[bad[0]]:.3g} from the derivative of its {('angle', 'rate')[k]} "
                f"at t = {t:.6g} s; (θ, θ', θ'') must be derivatives of each other"
            )


def pieces_of(histories: list[Represented]) -> Pieces:
    """Histories as kernels want them."""
    counts = [len(h.terms) for h in histories]
    terms = np.zeros((sum(counts), 3, TERMS))
    first = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)
    edges = np.zeros((2, sum(counts)))
    for h, at in zip(histories, first, strict=False):
        terms[at : at + len(h.terms), : h.terms.shape[1]] = h.terms
        edges[:, at : at + len(h.terms)] = h.edges[:-1], h.edges[1:]
    steady = [len(h.terms) == 1 and not h.terms[:, :, 1:].any() for h in histories]
    return Pieces(first, edges, terms, np.array(steady, dtype=np.bool_))


def constant(value: Array, t_end: float) -> Represented:
    """A history that never changes."""
    terms = np.zeros((1, len(value), TERMS))
    terms[0, :, 0] = value
    return Represented(np.array([0.0, t_end]), terms, np.zeros(0), np.abs(value))


@inlined
def piece_at(pieces, history, t, after):  # type: ignore[no-untyped-def]
    """Piece of a history that ends at t or holds it; if `after`, that starts at t or holds it."""
    low, high = pieces.first[history], pieces.first[history + 1] - 1
    while low < high:
        middle = (low + high) // 2
        end = pieces.edges[1, middle]
        if end < t or (after and end == t):
            low = middle + 1
        else:
            high = middle
    return low


@inlined
def value_at(pieces, piece, column, t):  # type: ignore[no-untyped-def]
    """Value of a piece's polynomial at t, by Clenshaw's recurrence."""
    start, end = pieces.edges[0, piece], pieces.edges[1, piece]
    x = ((t - start) - (end - t)) / (end - start)
    one, two = 0.0, 0.0
    for k in range(TERMS - 1, 0, -1):
        one, two = 2.0 * x * one - two + pieces.terms[piece, column, k], one
    return x * one - two + pieces.terms[piece, column, 0]
