"""The first script of a newcomer: a scene and its motion, in a process of its own.

    python -m studies.benchmark.newcomer SCENE INTEGRATOR

prints what was compiled, as JSON. It loads what such a script loads, and nothing of the suite beside.
"""

import json
import sys
from collections.abc import Callable
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

import anctmm as at

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
GRAVITY = (0.0, -9.81)
#: Steps of each integrator, s, elements of each beam, length of a run and time between outputs, s.
STEPS, MESH, T_END, OUTPUT_DT = {"zhai": 2e-5, "generalized-alpha": 2e-3}, 4, 0.1, 0.02
#: In the place of a scene: all is loaded, and nothing run.
NOTHING = "nothing"


def beam() -> at.Scene:
    """A clamped beam."""
    arm = at.Beam("arm", (0.0, 0.0), (1.0, 0.0), ROD, RUBBER)
    return at.Scene("beam", [arm], [at.Clamp("arm.start")], gravity=GRAVITY)


def tree() -> at.Scene:
    """A beam with a driven clamp that branches into two."""
    top = (0.0, 0.3)
    trunk = at.Beam("trunk", (0.0, 0.0), top, ROD, RUBBER)
    left, right = (at.Beam(n, top, (x, 0.5), ROD, RUBBER) for n, x in (("left", -0.2), ("right", 0.2)))
    drive = at.Clamp("trunk.start", angle=at.Quintic(turn=pi / 2, duration=1.0))
    fork = at.Weld("trunk.end", "left.start", "right.start")
    return at.Scene("tree", [trunk, left, right], [drive, fork], gravity=GRAVITY)


def plate() -> at.Scene:
    """A rigid plate at the end of a beam."""
    arm = at.Beam("arm", (0.0, 0.0), (0.5, 0.0), ROD, RUBBER)
    plate = at.RigidBody("plate", mass=0.5, inertia=3.3e-3, center=(0.6, 0.1), points={"a": (0.5, 0.0)})
    joints = [at.Pin("arm.start"), at.Pin("arm.end", "plate.a")]
    return at.Scene("plate", [arm, plate], joints, gravity=GRAVITY)


def spring() -> at.Scene:
    """A beam with a spring and a damper at its end."""
    arm = at.Beam("arm", (0.0, 0.0), (1.0, 0.0), ROD, RUBBER)
    held = at.Spring("arm.end", (1.2, 0.6), stiffness=20.0, damping=0.05)
    return at.Scene("spring", [arm], [at.Pin("arm.start")], connectors=[held], gravity=GRAVITY)


SCENES: dict[str, Callable[[], at.Scene]] = {"beam": beam, "tree": tree, "plate": plate, "spring": spring}


def ran(scene: str, integrator: str) -> dict[str, Any]:
    """Run a scene; how it ended, and what this process compiled.

    Returns
    -------
    dict
        `status`, `steps`; `kernels` and `compile_s`: compiled in this process, s of waiting, for a second process, too;
        `bytecode`: whether that of each module of anctmm's is kept.
    """
    dt = STEPS[integrator]
    s = at.solve(SCENES[scene](), mesh=MESH, integrator=integrator, dt=dt, t_end=T_END, output_dt=OUTPUT_DT)
    compiling = import_module("anctmm.jit.announcing").compiling
    loaded = [m for name, m in sys.modules.items() if name.partition(".")[0] == "anctmm"]
    files = [getattr(m, "__cached__", None) for m in loaded]
    return {
        "status": str(s.status),
        "steps": s.cost.steps,
        "kernels": compiling.kernels,
        "compile_s": compiling.seconds,
        "bytecode": all(file is not None and Path(file).exists() for file in files),
    }


def main(scene: str, integrator: str) -> None:
    """Print what a run compiled."""
    if scene == NOTHING:
        import_module("anctmm.jit.compiler.kernel_files")
        return
    print(json.dumps(ran(scene, integrator)))


if __name__ == "__main__":
    main(*sys.argv[1:])
