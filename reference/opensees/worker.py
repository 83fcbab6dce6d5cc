"""One analysis by OpenSees in a process of its own: a script that knows nothing of scenes.

OpenSees keeps one model a process, prints to the standard error and may end the process that uses it. What it is to
do comes as JSON on the standard input, see `reference.opensees.frame`. Every output is written to the file `rows` of
the folder named on the command line as soon as it is there, so that what was computed is kept whatever ends the
process; how the analysis ended is written to `end.json`.
"""

import json
import sys
from itertools import count, pairwise
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, BinaryIO

import numpy as np

try:
    import opensees.openseespy as ops
except ModuleNotFoundError:  # the other package of the same code
    import openseespy.opensees as ops

Job = dict[str, Any]
#: Part of the step after which accelerations at t = 0 are read. OpenSees begins with accelerations of zero, which makes
#: schemes of second order ones of first order.
FIRST = 1e-3
#: Newton corrections of that small step, in which everything is linear.
CORRECTIONS = 3
#: Newton corrections of a step at most.
MOST = 25
#: How often a load step is halved before a search for equilibria is given up.
HALVINGS = 6
#: Gauss points of the nonlinear beam: with more its axial strain, which is not constant, locks.
POINTS = 2


def main(job: Job, folder: Path) -> None:
    """Do a job, and say how it ended."""
    with (folder / "rows").open("wb") as rows:
        end = (_equilibria if job["static"] else _motion)(job, rows)
    (folder / "end.json").write_text(json.dumps(end | {"whole": process_time()}))


def _build(job: Job) -> None:
    """Nodes, supports, hinges and elements; nothing acts yet."""
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for tag, place in enumerate(job["nodes"], 1):
        ops.node(tag, *place)
    for tag, held in job["supports"]:
        ops.fix(tag, *held)
    for one, other in job["hinges"]:
        ops.equalDOF(one, other, 1, 2)
    ops.geomTransf("Corotational", 1)
    tags = count(1)
    for number, (E, A, I, density, nodes) in enumerate(job["beams"], 1):  # noqa: E741
        mass = ["-mass", density, *(["-cMass"] if job["consistent"] else [])]
        if job["nonlinear"]:
            ops.section("Elastic", number, E, A, I)
            ops.beamIntegration("Legendre", number, number, POINTS)
        for pair in pairwise(nodes):
            if job["nonlinear"]:
                ops.element("dispBeamColumnNL", next(tags), *pair, 1, number, *mass)
            else:
                ops.element("elasticBeamColumn", next(tags), *pair, A, E, I, 1, *mass)


def _act(job: Job, *series: Any) -> None:
    """Loads that are constant in time, or grow as a series says."""
    ops.timeSeries(*(series or ("Constant",)), 1)
    ops.pattern("Plain", 1, 1)
    for tag, load in job["loads"]:
        ops.load(tag, *load)


def _solver(job: Job, *integrator: Any, test: tuple[Any, ...]) -> None:
    ops.wipeAnalysis()
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system(job["system"])
    ops.test(*test)
    ops.algorithm(job["algorithm"])
    ops.integrator(*integrator)
    ops.analysis("Static" if job["static"] else "Transient")


def _keep(job: Job, rows: BinaryIO, time: float) -> None:
    """Write a time, the displacements of all nodes and, of a motion, their velocities."""
    tags = range(1, len(job["nodes"]) + 1)
    values = [time]
    for read in (ops.nodeDisp,) if job["static"] else (ops.nodeDisp, ops.nodeVel):
        for tag in tags:
            values += read(tag)
    rows.write(np.array(values).tobytes())
    rows.flush()


# --- motion --------------------------------------------------------------------------------------------------


def _motion(job: Job, rows: BinaryIO) -> dict[str, Any]:
    dt, stride, steps = job["dt"], job["stride"], job["steps"]
    _start(job, _first_accelerations(job))
    _solver(job, "HHTGeneralized", job["spectral_radius"], test=("NormDispIncr", job["bound"], MOST))
    _keep(job, rows, 0.0)
    cpu = wall = 0.0
    done = code = 0
    while done < steps and code == 0:
        part = min(stride, steps - done)
        begun, entered = process_time(), perf_counter()
        code = ops.analyze(part, dt)
        cpu, wall = cpu + process_time() - begun, wall + perf_counter() - entered
        if code == 0:
            done += part
            _keep(job, rows, done * dt)
    if code:
        done = round(ops.getTime() / dt)
    return {"code": code, "steps": done, "cpu": cpu, "wall": wall}


def _start(job: Job, accelerations: list[list[float]]) -> None:
    """The model with what acts on it, its velocities and accelerations at t = 0."""
    _build(job)
    _act(job)
    unit = np.eye(3).tolist()
    varying = [(ops.load, tag, unit[component], values) for tag, component, values in job["histories"]]
    varying += [(ops.sp, tag, [3, 1.0], values) for tag, values, _ in job["drives"]]
    for number, (act, tag, arguments, values) in enumerate(varying, 2):
        ops.timeSeries("Path", number, "-dt", job["dt"], "-values", *values)
        ops.pattern("Plain", number, number)
        act(tag, *arguments)
    for set_value, states in ((ops.setNodeVel, job["velocities"]), (ops.setNodeAccel, accelerations)):
        for tag, state in enumerate(states, 1):
            for component, value in enumerate(state, 1):
                if value:
                    set_value(tag, component, value, "-commit")


def _first_accelerations(job: Job) -> list[list[float]]:
    """Accelerations of all nodes at t = 0, by a step that is small against the run's."""
    small = FIRST * job["dt"]
    histories = [(tag, component, 2 * values[:1]) for tag, component, values in job["histories"]]
    drives = [
        (tag, [0.0, (rate + 0.5 * acceleration * small) * job["dt"]], None)
        for tag, _, (rate, acceleration) in job["drives"]
    ]
    _start(job | {"histories": histories, "drives": drives}, [])
    _solver(job, "Newmark", 0.5, 0.25, test=("FixedNumIter", CORRECTIONS))
    ops.analyze(1, small)
    return [list(ops.nodeAccel(tag)) for tag in range(1, len(job["nodes"]) + 1)]


# --- statics -------------------------------------------------------------------------------------------------


def _equilibria(job: Job, rows: BinaryIO) -> dict[str, Any]:
    """Equilibria under growing parts of the load; steps that fail are halved."""
    _build(job)
    _act(job, "Linear")
    _keep(job, rows, 0.0)
    cpu = wall = reached = 0.0
    taken = code = 0
    for k in range(1, job["steps"] + 1):
        goal, part = k / job["steps"], 1.0 / job["steps"]
        least = part / 2**HALVINGS
        while goal - reached > 1e-12 and part >= least:
            part = min(part, goal - reached)
            _solver(job, "LoadControl", part, test=("NormDispIncr", job["bound"], MOST))
            begun, entered = process_time(), perf_counter()
            code = ops.analyze(1)
            cpu, wall = cpu + process_time() - begun, wall + perf_counter() - entered
            taken += 1
            if code:
                part *= 0.5
            else:
                reached += part
        if code:
            break
        reached = goal
        _keep(job, rows, goal)
    return {"code": code, "steps": taken, "cpu": cpu, "wall": wall}


if __name__ == "__main__":
    main(json.load(sys.stdin), Path(sys.argv[1]))
