"""The element kernels behind one name each; only those of the kinds in a scene are compiled.

The type of the first argument, a tuple of zeros, encodes which kinds there are: numba selects the implementation by it.
Without numba's compiler the functions here are called directly.
"""

from collections.abc import Callable, Iterable, Mapping
from types import ModuleType
from typing import Any

from anctmm.elements.kinds import KINDS, ElementKind
from anctmm.jit.compiling import chosen_by_types, inlined

#: Modules of kernels, by the numbers by which kernels distinguish them.
KERNELS: Mapping[int, ModuleType] = dict(enumerate(dict.fromkeys(kind.kernels for kind in KINDS.values())))


def number_of(kind: ElementKind) -> int:
    """Number of the kernels of a kind."""
    return next(number for number, kernels in KERNELS.items() if kernels is kind.kernels)


#: Components of a node, by these numbers.
COMPONENTS = {number_of(kind): 2 * len(kind.vectors) for kind in KINDS.values()}


def formulations_of(numbers: Iterable[int]) -> tuple[int, ...]:
    """Tells the compiler which kernels are needed: a tuple whose length is the sum of 2 ** number."""
    return (0,) * sum(2**number for number in set(numbers))


#: That of all kernels.
ALL = formulations_of(KERNELS)


def components(formulations, kind):  # type: ignore[no-untyped-def]
    """Components of a node of an element: 4 of a cable, 6 of a shear element or a quintic cable."""
    return COMPONENTS[int(kind)]


def element_forces(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    """Elastic forces of a row of elements of one kind, as `shear_kernel.forces` gives them."""
    KERNELS[int(kind)].forces(q, node, count, constants, out)


def element_tangents(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    """Tangents of a row of elements of one kind, as `shear_kernel.tangents` gives them."""
    KERNELS[int(kind)].tangents(q, node, count, constants, out)


def element_energy(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
    """Strain energy of a row of elements of one kind, J."""
    return KERNELS[int(kind)].energy(q, node, count, constants)


def element_damping(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of a row of elements of one kind, as `shear_kernel.damping_forces` gives them."""
    KERNELS[int(kind)].damping_forces(q, v, node, count, constants, damping, out)


def _choice(formulations: Any, make: Callable[..., Any]) -> Any:
    """The implementation for the type of a formulations: its kinds are tried one after another.

    `make(number)` implements a kind alone, `make(number, rest)` tries it before the rest.
    """
    number, *others = (n for n in KERNELS if formulations.count & 2**n)
    found = make(number)
    for one in others:
        found = make(one, inlined(found))
    return found


@chosen_by_types(components)
def _components(formulations, kind):  # type: ignore[no-untyped-def]
    def make(number: int, rest: Any = None) -> Any:
        size = COMPONENTS[number]
        if rest is None:
            return lambda formulations, kind: size
        return lambda formulations, kind: size if kind == number else rest(formulations, kind)

    return _choice(formulations, make)


def _filling(name: str) -> Callable[..., Any]:
    """Makes implementations of a kernel that fills `out` from coordinates."""

    def make(number: int, rest: Any = None) -> Any:
        of_kind = getattr(KERNELS[number], name)

        def alone(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
            of_kind(q, node, count, constants, out)

        def before(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
            if kind == number:
                of_kind(q, node, count, constants, out)
            else:
                rest(formulations, kind, q, node, count, constants, out)

        return alone if rest is None else before

    return make


_forces, _tangents = _filling("forces"), _filling("tangents")


@chosen_by_types(element_forces)
def _element_forces(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    return _choice(formulations, _forces)


@chosen_by_types(element_tangents)
def _element_tangents(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    return _choice(formulations, _tangents)


@chosen_by_types(element_energy)
def _element_energy(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
    def make(number: int, rest: Any = None) -> Any:
        of_kind = KERNELS[number].energy

        def alone(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
            return of_kind(q, node, count, constants)

        def before(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
            if kind == number:
                return of_kind(q, node, count, constants)
            return rest(formulations, kind, q, node, count, constants)

        return alone if rest is None else before

    return _choice(formulations, make)


@chosen_by_types(element_damping)
def _element_damping(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
    def make(number: int, rest: Any = None) -> Any:
        of_kind = KERNELS[number].damping_forces

        def alone(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
            of_kind(q, v, node, count, constants, damping, out)

        def before(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
            if kind == number:
                of_kind(q, v, node, count, constants, damping, out)
            else:
                rest(formulations, kind, q, v, node, count, constants, damping, out)

        return alone if rest is None else before

    return _choice(formulations, make)
