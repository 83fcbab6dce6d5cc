"""What no beam does, found in a finished history: it is cut there, and its status says where and when.

Three signs that a run has diverged though its numbers are finite: a gradient beyond all bounds, an element turned
inside out (no energy of these elements forbids that), and, where an integrator may blow up, energy from nowhere.
They are looked for at the outputs, after the run: a step costs nothing.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.results.solution import Energy, HermiteField, Solution, Status

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
#: Number of the output, message with a place for when, body and element.
Fault = tuple[int, str, str | None, int | None]

EPS = float(np.finfo(float).eps)
#: A gradient longer than this is taken as divergence: no elastic beam stretches a thousandfold.
STRETCH_LIMIT = 1e3
#: Part of all energy present or exchanged that, come from nowhere, means that a run has diverged. A stable vibration at
#: a part x of the limit of its step shows up to 1/(1 − x²) times its energy: 0.81 from nowhere at x = 0.9.
NOWHERE = 0.85
#: Errors of strain that rounding of positions makes in a long run, in units of one rounding.
ROUNDINGS = 1e3
#: Elements times outputs that are looked at together: a bound of the memory this takes.
BATCH = 100_000


def inside_out(q: Array, length: float) -> Mask:
    """Whether elements are turned inside out.

    An element with an r_y is so where r_x × r_y ≤ 0 at a node or in its middle. An axis alone has no sides: it is so
    where it turns by more than half a circle within the element, so that it runs against its gradients at both ends.

    Parameters
    ----------
    q : ndarray, shape (n, nodes, 2 or 3, 2)
        r, r_x and r_y of each node.
    length : float
        Of an undeformed element, m.

    Returns
    -------
    ndarray of bool, shape (n, nodes − 1)
    """
    chord = np.diff(q[:, :, 0], axis=1)
    a, b = q[:, :-1, 1], q[:, 1:, 1]
    found = (_dot(a, chord) < 0.0) & (_dot(b, chord) < 0.0)
    if q.shape[2] == 3:
        sides = _cross(q[:, :, 1], q[:, :, 2])
        middle = _cross(1.5 * chord / length - 0.25 * (a + b), 0.5 * (q[:, :-1, 2] + q[:, 1:, 2]))
        found |= (sides[:, :-1] <= 0.0) | (sides[:, 1:] <= 0.0) | (middle <= 0.0)
    return found  # type: ignore[no-any-return]


def out_of_bounds(q: Array) -> Mask:
    """Whether a gradient at either node of an element, (n, nodes − 1), is too long or not a number."""
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(q[:, :, 1:]).max(axis=(2, 3)) <= STRETCH_LIMIT)
    return bad[:, :-1] | bad[:, 1:]  # type: ignore[no-any-return]


def from_nowhere(energy: Energy) -> Mask:
    """Whether nearly all of the energy at an output, (n,), is none that was there, came in or was exchanged."""
    parts = np.abs([energy.kinetic + energy.strain, energy.potential, energy.work])
    with np.errstate(invalid="ignore"):
        return energy.balance > NOWHERE * np.maximum.accumulate(parts.sum(axis=0))  # type: ignore[no-any-return]


def rounding_energy(solution: Solution) -> float:
    """Energy, J, that rounding alone may make: positions of size R are wrong by ε R, strains by ε R/l.

    A scene at rest has no other energy: what comes from nowhere there is no divergence.
    """
    total = 0.0
    for name, field in solution.fields.items():
        if isinstance(field, HermiteField) and field.coordinates.size:
            body, elements = solution.scene.body(name), field.coordinates.shape[1] - 1
            reach = float(np.abs(field.coordinates[0, :, 0]).max())
            strain = ROUNDINGS * EPS * reach * elements / field.length
            total += 0.5 * body.material.E * body.section.area * field.length * strain**2
    return total


def sound(solution: Solution, *, static: bool = False, energies: bool = True) -> Solution:
    """The solution, cut before the first output that no beam could have.

    Parameters
    ----------
    solution : Solution
        Of any solver; fields that are no `HermiteField` are not looked at.
    static : bool
        Whether its times are load factors.
    energies : bool
        Whether energies are exact enough to tell whether an explicit run has made some.

    Returns
    -------
    Solution
        The same, or a shorter one with the status "diverged".
    """
    explicit = not static and solution.run is not None and solution.run.integrator == "zhai"
    if explicit and not solution.status.ok:  # an unstable step shows in all three; its solver knows it best
        return solution
    faults = list(_faults(solution))
    if energies and explicit:
        faults += _made_energy(solution)
    if not faults:
        return solution
    k, message, body, element = min(faults, key=lambda fault: fault[0])
    when, run = float(solution.t[k]), solution.run
    step = None if static or run is None or run.tolerance is not None else int(run.output_steps[k])
    said = f"load factor {when:.6g}" if static else f"t = {when:.6g} s"
    fields = {
        n: replace(f, coordinates=f.coordinates[:k]) if isinstance(f, HermiteField) else f
        for n, f in solution.fields.items()
    }
    return replace(
        solution,
        t=solution.t[:k],
        fields=fields,
        energy=Energy(*(series[:k] for series in vars(solution.energy).values())),
        status=Status("diverged", message.format(when=said), when, step, body, element),
    )


def _faults(solution: Solution) -> Iterator[Fault]:
    """The first fault of each body."""
    for name, field in solution.fields.items():
        if not isinstance(field, HermiteField):
            continue
        q, size = field.coordinates, max(1, BATCH // field.coordinates.shape[1])
        for first in range(0, len(q), size):
            part = q[first : first + size]
            wild = out_of_bounds(part)
            with np.errstate(invalid="ignore", over="ignore"):
                bad = wild | inside_out(part, field.length / (q.shape[1] - 1))
            if bad.any():
                k = int(bad.any(axis=1).argmax())
                stretched = bool(wild[k].any())
                element = int((wild if stretched else bad)[k].argmax())
                yield first + k, _message(stretched, name, element), name, element
                break


def _made_energy(solution: Solution) -> list[Fault]:
    """The fault of an explicit run that makes energy, if it does."""
    bad = from_nowhere(solution.energy) & (solution.energy.balance > rounding_energy(solution))
    if not bad.any():
        return []
    assert solution.run is not None
    k = int(bad.argmax())
    body, element = _most_stretched(solution, k)
    message = (
        "nearly all energy at {when} came from nowhere, where an explicit step is above the stability limit, which "
        f"deformation lowers; worst in element {element} of body {body!r}; a smaller dt than "
        f"{solution.run.dt:g} s may do"
    )
    return [(k, message, body, element)]


def _most_stretched(solution: Solution, k: int) -> tuple[str | None, int | None]:
    """Body and element with the largest gradient at an output."""
    sizes = {
        n: np.abs(f.coordinates[k, :, 1:]).max(axis=(1, 2))
        for n, f in solution.fields.items()
        if isinstance(f, HermiteField)
    }
    if not sizes:
        return None, None
    body = max(sizes, key=lambda n: float(sizes[n].max()))
    return body, min(int(sizes[body].argmax()), len(sizes[body]) - 2)


def _message(wild: bool, body: str, element: int) -> str:
    if wild:
        return (
            f"gradients grew beyond {STRETCH_LIMIT:g} by {{when}} in element {element} of body {body!r}; "
            f"a smaller dt or smaller loads may do"
        )
    return (
        f"element {element} of body {body!r} is turned inside out at {{when}}; "
        f"a finer mesh, a smaller dt or smaller loads may do"
    )


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=-1)  # type: ignore[no-any-return]


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]  # type: ignore[no-any-return]
