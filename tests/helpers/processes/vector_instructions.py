"""Prints the vector operations in the steps of an element and an integrator, and in the element's forces alone.

Then the loads of vectors whose numbers the compiler gathers one by one, in the element's kernels alone.

In a process of its own with an empty directory of kernels: code that is read from there shows no instructions.
"""

import re
import sys
from types import ModuleType
from typing import Any, ClassVar

import anctmm as at
from anctmm.elements import cable_kernel, quintic_kernel, shear_kernel
from anctmm.jit.compiler import kernels
from anctmm.jit.compiler.second_process import one_process

ELEMENTS: dict[str, ModuleType] = {"cable": cable_kernel, "quintic": quintic_kernel, "shear": shear_kernel}


def vector_operations(code: str) -> int:
    """Additions, multiplications and divisions of several numbers at once."""
    return len(re.findall(r"= f(?:mul|add|sub|div)[^\n]*<\d+ x double>", code))


def gathered(code: str) -> int:
    """Loads of vectors whose numbers do not follow each other in memory, as far as the compiler knows."""
    return len(re.findall(r"call <[^\n]*@llvm\.masked\.gather", code))


class Watched(kernels.KernelLibrary):
    """Machine code whose vector operations and gathered loads are counted when it is made."""

    made: ClassVar[dict[str, int]] = {}
    gathered: ClassVar[dict[str, int]] = {}

    def _finalize_final_module(self):
        super()._finalize_final_module()
        code = str(self._final_module)
        self.made[self.name], self.gathered[self.name] = vector_operations(code), gathered(code)


def most(element: str, integrator: str) -> int:
    """Vector operations of the kernel that has most of them, of all that a short run compiles."""
    Watched.made.clear()
    beam = at.Beam("beam", (0, 0), (1, 0), at.Rectangle(0.02, 0.02), at.Material(E=1e7, density=1e3))
    scene = at.Scene("clamped", [beam], [at.Clamp("beam.start")], gravity=(0, -9.81))
    at.solve(scene, mesh=2, element=element, integrator=integrator, dt=1e-6, t_end=1e-6)
    return max(Watched.made.values())


def alone(element: str) -> tuple[int, int]:
    """Vector operations of its forces, and gathered loads of its forces, damping and tangents, each by itself."""
    Watched.made.clear()
    Watched.gathered.clear()
    module = ELEMENTS[element]
    q, first, count, constants, out = next(iter(module.forces.overloads))
    compiled_alone(module.forces, (q, first, count, constants, out))
    compiled_alone(module.damping_forces, (q, q, first, count, constants, constants.dtype, out))
    compiled_alone(module.tangents, (q, first, count, constants, out))
    return Watched.made[module.forces.py_func.__qualname__], sum(Watched.gathered.values())


def compiled_alone(kernel: Any, types: tuple[Any, ...]) -> None:
    """Compile a kernel anew, as no part of another one."""
    kernels.Kernel(kernel.py_func, targetoptions=kernel.kernel.targetoptions).compile(types)


if __name__ == "__main__":
    kernels.KernelLibrary = Watched
    with one_process():
        print(most(*sys.argv[1:]), *alone(sys.argv[1]))
