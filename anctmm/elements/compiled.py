"""Element kernels as C functions, which other kernels call by their address.

An element that a scene does not have is not compiled, and none is compiled more than once, wherever it is called. A
call is for many elements.
"""

from functools import cache
from types import ModuleType
from typing import Any

from numba import carray, types

from anctmm.elements import cable_kernel, quintic_kernel, shear_kernel, spatial_cable_kernel
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.kernels.options import c_function

#: Modules of kernels by kind of element; each has `forces`, `damping_forces`, `tangents`, `energy` and `constants`.
MODULES: dict[str, ModuleType] = {
    "cable": cable_kernel,
    "shear": shear_kernel,
    "quintic": quintic_kernel,
    "spatial_cable": spatial_cable_kernel,
}
#: Numbers of an element, rows of coordinates and numbers of the output, at most.
NUMBERS, ROWS, ROOM = 96, 12, TANGENT_BUFFER

_P, _N = types.CPointer(types.float64), types.intp
#: q and v, (rows, nodes), nodes, first node, elements, constants, damping (s), and the output.
SIGNATURE = types.void(_P, _P, _N, _N, _N, _P, types.float64, _P)


@cache
def address(kind: str, what: str) -> int:
    """Address of a kernel of a kind of element: "forces", "damping", "tangents" or "energy"."""
    return int(_compiled(kind, what).address)


@cache
def _compiled(kind: str, what: str) -> Any:
    return c_function(SIGNATURE, globals()[f"{kind}_{what}"])


def cable_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of cable elements."""
    cable_kernel.forces(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def cable_damping(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of cable elements."""
    x, y = carray(q, (ROWS, nodes)), carray(v, (ROWS, nodes))
    cable_kernel.damping_forces(
        x, y, first, count, carray(constants, (NUMBERS,)), damping, carray(out, (ROOM,))
    )


def cable_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of cable elements."""
    cable_kernel.tangents(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def cable_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of cable elements."""
    carray(out, (ROOM,))[0] = cable_kernel.energy(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,))
    )


def shear_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of shear elements."""
    shear_kernel.forces(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def shear_damping(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of shear elements."""
    x, y = carray(q, (ROWS, nodes)), carray(v, (ROWS, nodes))
    shear_kernel.damping_forces(
        x, y, first, count, carray(constants, (NUMBERS,)), damping, carray(out, (ROOM,))
    )


def shear_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of shear elements."""
    shear_kernel.tangents(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def shear_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of shear elements."""
    carray(out, (ROOM,))[0] = shear_kernel.energy(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,))
    )


def quintic_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of quintic elements."""
    quintic_kernel.forces(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def quintic_damping(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of quintic elements."""
    x, y = carray(q, (ROWS, nodes)), carray(v, (ROWS, nodes))
    quintic_kernel.damping_forces(
        x, y, first, count, carray(constants, (NUMBERS,)), damping, carray(out, (ROOM,))
    )


def quintic_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of quintic elements."""
    quintic_kernel.tangents(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def quintic_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of quintic elements."""
    carray(out, (ROOM,))[0] = quintic_kernel.energy(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,))
    )


def spatial_cable_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of cable elements in space."""
    spatial_cable_kernel.forces(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def spatial_cable_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of cable elements in space."""
    spatial_cable_kernel.tangents(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,)), carray(out, (ROOM,))
    )


def spatial_cable_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of cable elements in space."""
    carray(out, (ROOM,))[0] = spatial_cable_kernel.energy(
        carray(q, (ROWS, nodes)), first, count, carray(constants, (NUMBERS,))
    )
