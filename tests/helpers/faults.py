"""Faults that `anctmm check` must see, each planted where the solver reads it.

As a script, with compilation off, it checks the scenes of a file with each fault in turn, and prints the verdicts:
    NUMBA_DISABLE_JIT=1 python faults.py SCENES BASELINES
"""

import ast
import inspect
import json
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anctmm.discretise import kept_chains
from anctmm.elements import cable, shear_kernel
from anctmm.elements.shapes import gauss, hermite
from anctmm.integrators import zhai as explicit
from anctmm.recursion import node_blocks
from studies.regression.check import check
from studies.regression.scenes import declared_in, tasks_of


def denser(scene, factor=1.0 + 1e-6):
    """The same scene of a material whose density is off."""
    bodies = [
        replace(b, material=replace(b.material, density=b.material.density * factor)) for b in scene.bodies
    ]
    return replace(scene, bodies=bodies)


def one_gauss_point_less_of_the_cable(patch):
    patch.setitem(cable.RULES, "full", (gauss, 4, gauss, 3))


def one_gauss_point_less_of_the_shear_element(patch):
    """The kernel's five points become the four of the smaller rule, and one without weight."""
    xi, w = gauss(4)
    table = np.column_stack([xi, 1.0 - xi, hermite(xi, 1.0, 1)[:, [0, 1, 3]]])
    for k in range(5):
        patch.setattr(shear_kernel, f"P{k}", tuple(map(float, table[min(k, 3)])))
        patch.setattr(shear_kernel, f"W{k}", float(w[k]) if k < 4 else 0.0)


def zhais_psi_a_little_less(patch):
    right = explicit.Numbers
    patch.setattr(
        explicit, "Numbers", lambda steps, stride, dt, psi, phi: right(steps, stride, dt, 0.49, phi)
    )


def swapped_sign_in_the_transfer_of_the_mass(patch):
    """L of the first free node: what it passes of the load on its position to the gradient of the next."""
    right = explicit.split_factors

    def wrong(chain):
        factors = right(chain)
        factors.L[2, int(np.flatnonzero(factors.L[2])[0])] *= -1.0
        return factors

    patch.setattr(explicit, "split_factors", wrong)


def swapped_sign_in_the_transfer_of_the_tangent(patch):
    """A component that is eliminated is added to the coupling of the others: the last `-=` of `update_row`."""
    patch.setattr(node_blocks, "update_row", with_last_minus_swapped(node_blocks.update_row))


def with_last_minus_swapped(function):
    """A function of one module whose last `-=` is a `+=`."""
    function = inspect.unwrap(function)  # a kernel that is not made yet has no globals
    tree = ast.parse(inspect.getsource(function))
    lines = [n for n in ast.walk(tree) if isinstance(n, ast.AugAssign) and isinstance(n.op, ast.Sub)]
    max(lines, key=lambda line: line.lineno).op = ast.Add()
    tree.body[0].decorator_list.clear()
    made = {}
    exec(compile(tree, function.__name__, "exec"), function.__globals__, made)
    return made[function.__name__]


#: Those that the compiled solver sees, because they are data to it.
AS_DATA = (
    one_gauss_point_less_of_the_cable,
    zhais_psi_a_little_less,
    swapped_sign_in_the_transfer_of_the_mass,
)
#: Those that stand in the code: compilation must be off.
IN_CODE = (one_gauss_point_less_of_the_shear_element, swapped_sign_in_the_transfer_of_the_tangent)
#: What of `watched_scenes.py` is run with each. (With a wrong tangent, statics would try ever smaller load steps.)
RUNS = {
    one_gauss_point_less_of_the_cable: "cable",
    zhais_psi_a_little_less: "explicit",
    swapped_sign_in_the_transfer_of_the_mass: "explicit",
    one_gauss_point_less_of_the_shear_element: "shear",
    swapped_sign_in_the_transfer_of_the_tangent: "implicit",
}


@contextmanager
def planted(fault):
    """The fault is there inside, and nothing that was found without it."""
    forget()
    with pytest.MonkeyPatch.context() as patch:
        fault(patch)
        yield
    forget()


def forget():
    """Empty what functions of the solver keep of earlier calls: chains, meshes, constants, frequency bounds."""
    kept_chains.forget()
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == "anctmm":
            for thing in list(vars(module).values()):
                if hasattr(thing, "cache_clear"):
                    thing.cache_clear()


def verdicts(scenes, baselines):
    """Verdict, reason, and difference over tolerance of every run, without a fault and with each."""
    tasks = tasks_of(declared_in(scenes))

    def found(part=""):
        return {
            f.name: (f.verdict, f.reason, f.worst and f.worst.difference / f.worst.tolerance)
            for findings in check([t for t in tasks if part in t.run_name], baselines)
            for f in findings
        }

    table = {"none": found()}
    for fault in AS_DATA + IN_CODE:
        with planted(fault):
            table[fault.__name__] = found(RUNS[fault])
    return table


if __name__ == "__main__":
    print(json.dumps(verdicts(Path(sys.argv[1]), Path(sys.argv[2]))))
