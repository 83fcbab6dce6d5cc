"""Prints the vector operations in the steps of an element and an integrator, and in the element's forces alone.

In a process of its own with an empty directory of kernels: code that is read from there shows no instructions.
"""

import re
import sys
from types import ModuleType
from typing import ClassVar

import anctmm as at
from anctmm.elements import cable_kernel, quintic_kernel, shear_kernel
from anctmm.jit.compiler import kernels
from anctmm.jit.compiler.second_process import one_process

ELEMENTS: dict[str, ModuleType] = {"cable": cable_kernel, "quintic": quintic_kernel, "shear": shear_kernel}


def vector_operations(code: str) -> int:
    """Additions, multiplications and divisions of several numbers at once."""
    return len(re.findall(r"= f(?:mul|add|sub|div)[^\n]*<\d+ x double>", code))


class Watched(kernels.KernelLibrary):
    """Machine code whose vector operations are counted when it is made."""

    made: ClassVar[dict[str, int]] = {}

    def _finalize_final_module(self):
        super()._finalize_final_module()
        self.made[self.name] = vector_operations(str(self._final_module))


def most(element: str, integrator: str) -> int:
    """Vector operations of the kernel that has most of them, of all that a short run compiles."""
    Watched.made.clear()
    beam = at.Beam("beam", (0, 0), (1, 0), at.Rectangle(0.02, 0.02), at.Material(E=1e7, density=1e3))
    scene = at.Scene("clamped", [beam], [at.Clamp("beam.start")], gravity=(0, -9.81))
    at.solve(scene, mesh=2, element=element, integrator=integrator, dt=1e-6, t_end=1e-6)
    return max(Watched.made.values())


def alone(element: str) -> int:
    """Those of the kernel of its forces, when it is optimised by itself."""
    Watched.made.clear()
    forces = ELEMENTS[element].forces
    signature = next(iter(forces.overloads))
    fresh = kernels.Kernel(forces.py_func, targetoptions=forces.kernel.targetoptions)
    fresh.compile(signature)
    return Watched.made[forces.py_func.__qualname__]


if __name__ == "__main__":
    kernels.KernelLibrary = Watched
    with one_process():
        print(most(*sys.argv[1:]), alone(sys.argv[1]))
