"""Element kernels as C functions, which other kernels call by their address.

An element that a scene does not have is not compiled, and none is compiled more than once, wherever it is called. A
call is for many elements.
"""

from functools import cache
from types import FunctionType, ModuleType
from typing import Any

from numba import carray, types

from anctmm.elements import cable_kernel as cable_source
from anctmm.elements import force_blocks, tangent_blocks, thin_beam
from anctmm.elements import quintic_kernel as quintic_source
from anctmm.elements import shear_kernel as shear_source
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.kernels.options import c_function, inlined

#: Modules of kernels by kind of element; each has `forces`, `damping_forces`, `tangents`, `energy` and `constants`.
MODULES: dict[str, ModuleType] = {"cable": cable_source, "shear": shear_source, "quintic": quintic_source}
#: Numbers of an element, rows of coordinates and numbers of the output, at most.
NUMBERS, ROWS, ROOM = 96, 12, TANGENT_BUFFER

_P, _N = types.CPointer(types.float64), types.intp
#: q and v, (rows, nodes), nodes, first node, elements, constants, damping (s), and the output.
SIGNATURE = types.void(_P, _P, _N, _N, _N, _P, types.float64, _P)


def _inlined_parts(*modules: ModuleType) -> dict[str, Any]:
    """The kernels of modules, each as a part of the C functions below.

    The kernels are shared with `anctmm.recursion`, which compiles them in its own way; this function goes with it.
    """
    found: dict[str, Any] = {}
    for module in modules:
        found |= {name: thing for name, thing in vars(module).items() if not name.startswith("__")}
    for name, thing in list(found.items()):
        if isinstance(plain := getattr(thing, "py_func", None), FunctionType):
            copy = FunctionType(plain.__code__, found, name, plain.__defaults__)
            found[name] = inlined(copy)
    return found


_SHARED = (force_blocks, tangent_blocks, thin_beam)
_cable = _inlined_parts(*_SHARED, cable_source)
cable_forces_part, cable_damping_forces_part = _cable["forces"], _cable["damping_forces"]
cable_tangents_part, cable_energy_part = _cable["tangents"], _cable["energy"]
_shear = _inlined_parts(*_SHARED, shear_source)
shear_forces_part, shear_damping_forces_part = _shear["forces"], _shear["damping_forces"]
shear_tangents_part, shear_energy_part = _shear["tangents"], _shear["energy"]
_quintic = _inlined_parts(*_SHARED, quintic_source)
quintic_forces_part, quintic_damping_forces_part = _quintic["forces"], _quintic["damping_forces"]
quintic_tangents_part, quintic_energy_part = _quintic["tangents"], _quintic["energy"]


@cache
def address(kind: str, what: str) -> int:
    """Address of a kernel of a kind of element: "forces", "damping", "tangents" or "energy"."""
    return int(_compiled(kind, what).address)


@cache
def _compiled(kind: str, what: str) -> Any:
    return c_function(SIGNATURE, globals()[f"{kind}_{what}"])


@inlined
def _table(numbers):  # type: ignore[no-untyped-def]
    return carray(numbers, (NUMBERS,))


@inlined
def _nodes(q, nodes):  # type: ignore[no-untyped-def]
    return carray(q, (ROWS, nodes))


@inlined
def _room(out):  # type: ignore[no-untyped-def]
    return carray(out, (ROOM,))


def cable_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of cable elements."""
    cable_forces_part(_nodes(q, nodes), first, count, _table(constants), _room(out))


def cable_damping(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of cable elements."""
    x, y = _nodes(q, nodes), _nodes(v, nodes)
    cable_damping_forces_part(x, y, first, count, _table(constants), damping, _room(out))


def cable_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of cable elements."""
    cable_tangents_part(_nodes(q, nodes), first, count, _table(constants), _room(out))


def cable_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of cable elements."""
    _room(out)[0] = cable_energy_part(_nodes(q, nodes), first, count, _table(constants))


def shear_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of shear elements."""
    shear_forces_part(_nodes(q, nodes), first, count, _table(constants), _room(out))


def shear_damping(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of shear elements."""
    x, y = _nodes(q, nodes), _nodes(v, nodes)
    shear_damping_forces_part(x, y, first, count, _table(constants), damping, _room(out))


def shear_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of shear elements."""
    shear_tangents_part(_nodes(q, nodes), first, count, _table(constants), _room(out))


def shear_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of shear elements."""
    _room(out)[0] = shear_energy_part(_nodes(q, nodes), first, count, _table(constants))


def quintic_forces(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Elastic forces of quintic elements."""
    quintic_forces_part(_nodes(q, nodes), first, count, _table(constants), _room(out))


def quintic_damping(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Damping forces of quintic elements."""
    x, y = _nodes(q, nodes), _nodes(v, nodes)
    quintic_damping_forces_part(x, y, first, count, _table(constants), damping, _room(out))


def quintic_tangents(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Tangents of quintic elements."""
    quintic_tangents_part(_nodes(q, nodes), first, count, _table(constants), _room(out))


def quintic_energy(q, v, nodes, first, count, constants, damping, out):  # type: ignore[no-untyped-def]
    """Strain energy of quintic elements."""
    _room(out)[0] = quintic_energy_part(_nodes(q, nodes), first, count, _table(constants))
