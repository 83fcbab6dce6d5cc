"""The element kernels behind one name each; only those of the kinds that a scene has are compiled.

The type of the first argument, a tuple of zeros, says which kinds there are: numba chooses the implementation by it.
Without numba's compiler the functions here are called themselves.
"""

from collections.abc import Callable, Iterable, Mapping
from types import ModuleType
from typing import Any

from anctmm.elements import cable_kernel, shear_kernel
from anctmm.elements.kinds import CABLE, SHEAR
from anctmm.jit.compiling import chosen_by_types

#: Modules of kernels, by the number that a kind of element has of them.
KERNELS: Mapping[int, ModuleType] = {CABLE: cable_kernel, SHEAR: shear_kernel}
#: Kernels that a scene needs, by the length of the tuple: the sum of 2 ** number.
CABLES, SHEARS, BOTH = (0,), (0, 0), (0, 0, 0)


def formulations_of(numbers: Iterable[int]) -> tuple[int, ...]:
    """CABLES, SHEARS or BOTH: what tells the compiler which kernels are needed."""
    return (0,) * sum(2**number for number in set(numbers))


def components(formulations, kind):  # type: ignore[no-untyped-def]
    """Components of a node of an element: 4 of a cable, 6 of a shear element."""
    return 6 if kind == SHEAR else 4


def element_forces(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    """Elastic forces of a row of elements of one kind, as `shear_kernel.forces` gives them."""
    if kind == SHEAR:
        shear_kernel.forces(q, node, count, constants, out)
    else:
        cable_kernel.forces(q, node, count, constants, out)


def element_tangents(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    """Tangents of a row of elements of one kind, as `shear_kernel.tangents` gives them."""
    if kind == SHEAR:
        shear_kernel.tangents(q, node, count, constants, out)
    else:
        cable_kernel.tangents(q, node, count, constants, out)


def element_energy(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
    """Strain energy of a row of elements of one kind, J."""
    if kind == SHEAR:
        return shear_kernel.energy(q, node, count, constants)
    return cable_kernel.energy(q, node, count, constants)


def element_damping(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of a row of elements of one kind, as `shear_kernel.damping_forces` gives them."""
    if kind == SHEAR:
        shear_kernel.damping_forces(q, v, node, count, constants, damping, out)
    else:
        cable_kernel.damping_forces(q, v, node, count, constants, damping, out)


def _choose(
    formulations: Any, cables: Callable[..., Any], shears: Callable[..., Any], both: Callable[..., Any]
) -> Any:
    """The implementation for the type of a formulations."""
    return (cables, shears, both)[formulations.count - 1]


@chosen_by_types(components)
def _components(formulations, kind):  # type: ignore[no-untyped-def]
    return _choose(formulations, lambda formulations, kind: 4, lambda formulations, kind: 6, components)


@chosen_by_types(element_forces)
def _element_forces(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    def cables(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
        cable_kernel.forces(q, node, count, constants, out)

    def shears(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
        shear_kernel.forces(q, node, count, constants, out)

    return _choose(formulations, cables, shears, element_forces)


@chosen_by_types(element_tangents)
def _element_tangents(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
    def cables(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
        cable_kernel.tangents(q, node, count, constants, out)

    def shears(formulations, kind, q, node, count, constants, out):  # type: ignore[no-untyped-def]
        shear_kernel.tangents(q, node, count, constants, out)

    return _choose(formulations, cables, shears, element_tangents)


@chosen_by_types(element_energy)
def _element_energy(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
    def cables(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
        return cable_kernel.energy(q, node, count, constants)

    def shears(formulations, kind, q, node, count, constants):  # type: ignore[no-untyped-def]
        return shear_kernel.energy(q, node, count, constants)

    return _choose(formulations, cables, shears, element_energy)


@chosen_by_types(element_damping)
def _element_damping(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
    def cables(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
        cable_kernel.damping_forces(q, v, node, count, constants, damping, out)

    def shears(formulations, kind, q, v, node, count, constants, damping, out):  # type: ignore[no-untyped-def]
        shear_kernel.damping_forces(q, v, node, count, constants, damping, out)

    return _choose(formulations, cables, shears, element_damping)
