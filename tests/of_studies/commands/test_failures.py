"""Whatever is wrong is told: the thing, its value and what is allowed, by an error, a row or a line of the command."""

import errno
import os
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from samples import A, B, C, bar, beam, run_of, scene_of
from typer.testing import CliRunner

import anctmm as at
from anctmm import errors
from anctmm.jit import compiling
from anctmm.jit.compiler import kernel_files
from anctmm.jit.files import cache_dir as storage
from anctmm.model.drives import Pulse, Quintic, tabulate
from anctmm.model.scene import Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Circle, Rectangle, Section
from anctmm.solvers import registry
from anctmm.solvers.registry import solver
from reference import exudyn_cable, exudyn_reissner, global_dae
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Reference
from studies.engine.running.rows import row
from studies.engine.running.trial import Trial
from studies.engine.storage.files import atomic_write, check_writable
from studies.engine.storage.store import MAGIC, Store
from studies.regression.check import BASELINES
from studies.regression.history import CheckError, read_baseline
from studies.scenes import cantilever_fall

#: What is wrong: how to make it, the error's class, and what its message must hold.
SCENES = {
    # bodies
    "length 0": (
        lambda: beam(end=A),
        errors.DegenerateBodyError,
        ["'a'", "length 0", "(0.0, 0.0)", "two distinct"],
    ),
    "no name": (lambda: beam(name=""), errors.PropertyError, ["name", "''", "non-empty"]),
    "name not text": (lambda: beam(name=3), errors.PropertyError, ["name", "3", "string"]),
    "start not a pair": (lambda: beam(start=(1.0,)), errors.PropertyError, ["'a' start", "(1.0,)", "pair"]),
    "end not finite": (lambda: beam(end=(nan, 0.0)), errors.PropertyError, ["'a' end", "nan", "finite"]),
    "section missing": (lambda: beam(section=0.1), errors.PropertyError, ["section", "0.1", "Section"]),
    "material missing": (
        lambda: beam(material=1e9),
        errors.PropertyError,
        ["material", "1000000000.0", "Material"],
    ),
    "velocity not a pair": (
        lambda: bar(velocity=lambda s: 1.0).body("bar").velocity_at(0.5),
        errors.PropertyError,
        ["'bar' velocity", "0.5", "1.0", "pair"],
    ),
    # properties
    "negative E": (lambda: Material(-1.0, 1.0), errors.PropertyError, ["E (Pa)", "-1.0", "greater than 0"]),
    "infinite E": (lambda: Material(inf, 1.0), errors.PropertyError, ["E (Pa)", "inf", "finite"]),
    "density 0": (lambda: Material(1.0, 0.0), errors.PropertyError, ["density", "0.0", "greater than 0"]),
    "density text": (lambda: Material(1.0, "x"), errors.PropertyError, ["density", "'x'", "finite number"]),
    "poisson ½": (lambda: Material(1.0, 1.0, 0.5), errors.PropertyError, ["poisson", "0.5", "[0, 0.5)"]),
    "poisson negative": (
        lambda: Material(1.0, 1.0, -0.1),
        errors.PropertyError,
        ["poisson", "-0.1", "[0, 0.5)"],
    ),
    "area nan": (lambda: Section(nan, 1.0, 1.0), errors.PropertyError, ["area", "nan", "finite"]),
    "moment negative": (
        lambda: Section(1.0, -1.0, 1.0),
        errors.PropertyError,
        ["second_moment", "-1.0", "greater"],
    ),
    "impossible J": (
        lambda: Section(1.0, 1.0, 0.5),
        errors.PropertyError,
        ["fourth_moment", "0.5", "I²/A = 1.0"],
    ),
    "diameter 0": (lambda: Circle(0.0), errors.PropertyError, ["diameter", "0.0", "greater than 0"]),
    "height negative": (
        lambda: Rectangle(1.0, -2.0),
        errors.PropertyError,
        ["height", "-2.0", "greater than 0"],
    ),
    "force not finite": (
        lambda: Force("a.end", (0, inf)),
        errors.PropertyError,
        ["'a.end'", "inf", "finite"],
    ),
    "force a number": (lambda: Force("a.end", 1.0), errors.PropertyError, ["'a.end'", "1.0", "pair"]),
    "torque a pair": (
        lambda: Torque("a.end", (1.0, 0.0)),
        errors.PropertyError,
        ["'a.end'", "(1.0, 0.0)", "finite"],
    ),
    "turn nan": (lambda: Quintic(nan, 1.0), errors.PropertyError, ["turn", "nan", "finite"]),
    "duration 0": (lambda: Pulse(1.0, 0.0), errors.PropertyError, ["duration", "0.0", "greater than 0"]),
    # scenes
    "no bodies": (lambda: Scene("s", []), errors.SceneError, ["'s'", "no bodies", "at least one"]),
    "two of one name": (
        lambda: scene_of(bodies=[beam(), beam()]),
        errors.DuplicateNameError,
        ["'a'", "2 times", "once is allowed"],
    ),
    "not a beam": (lambda: Scene("s", ["a"]), errors.SceneError, ["bodies", "'a'", "Beam"]),
    "not a joint": (lambda: scene_of("hinge"), errors.SceneError, ["joints", "'hinge'", "Pin, Weld, Clamp"]),
    "not a load": (lambda: scene_of(loads=[3.0]), errors.SceneError, ["loads", "3.0", "Force, Torque"]),
    "gravity a number": (lambda: scene_of(gravity=-9.81), errors.PropertyError, ["gravity", "-9.81", "pair"]),
    "unknown body": (lambda: scene_of(Pin("c.end")), errors.UnknownNameError, ["'c'", "'a', 'b'"]),
    "unknown end": (
        lambda: scene_of(Pin("a.middle")),
        errors.UnknownNameError,
        ["'a.middle'", "'a.start', 'a.end' and ('a', fraction)"],
    ),
    "end without body": (lambda: scene_of(Clamp("end")), errors.UnknownNameError, ["'end'", "name.start"]),
    "end not text": (lambda: scene_of(Pin(3)), errors.UnknownNameError, ["3", "name.start"]),
    "load on nothing": (
        lambda: scene_of(loads=[Torque("c.end", 1.0)]),
        errors.UnknownNameError,
        ["'c'", "'a', 'b'"],
    ),
    "unknown body asked for": (
        lambda: scene_of().body("c"),
        errors.UnknownNameError,
        ["'c'", "'s'", "'a', 'b'"],
    ),
    "probe beyond": (lambda: scene_of().probe(("a", 1.5)), errors.PropertyError, ["'a'", "1.5", "[0, 1]"]),
    "end held twice": (
        lambda: scene_of(Pin("a.end", "b.start", grounded=True), Clamp("a.end")),
        errors.RepeatedJointError,
        ["'a.end'", "Clamp", "Pin", "as", "already"],
    ),
    "end joined to itself": (
        lambda: scene_of(Pin("a.end", "a.end")),
        errors.EndJoinedTwiceError,
        ["Pin", "'a.end'", "2 times", "once"],
    ),
    "pin of nothing": (lambda: scene_of(Pin()), errors.SceneError, ["Pin", "0 end(s)"]),
    "weld of one end": (
        lambda: scene_of(Weld("a.end")),
        errors.SceneError,
        ["Weld", "1 end(s)", "two or more are needed"],
    ),
    "ends apart": (
        lambda: scene_of(Pin("a.start", "b.start")),
        errors.JointGapError,
        ["Pin", "(0.0, 0.0)", "(1.0, 0.0)", "1 m apart", "allowed"],
    ),
    "ends drift apart": (
        lambda: scene_of(
            Pin("a.end", "b.start"), bodies=[beam(velocity=lambda s: (s, 0.0)), beam("b", B, C)]
        ),
        errors.JointGapError,
        ["velocities", "(1.0, 0.0)", "(0.0, 0.0)", "equal"],
    ),
    "held end moves": (
        lambda: bar([Pin("bar.start")], velocity=lambda s: (1.0, 0.0)),
        errors.JointGapError,
        ["'bar.start'", "(1.0, 0.0)", "(0, 0) is needed"],
    ),
    "angle a number": (
        lambda: scene_of(Clamp("a.start", 1.0)),
        errors.PropertyError,
        ["'a.start'", "1.0", "callable"],
    ),
    "angle of one value": (
        lambda: scene_of(Clamp("a.start", lambda t: t)),
        errors.PropertyError,
        ["'a.start' angle", "3 finite", "t = 0.0"],
    ),
    "angle not 0 at first": (
        lambda: scene_of(Clamp("a.start", lambda t: (1.0, 0.0, 0.0))),
        errors.PropertyError,
        ["'a.start'", "1.0 rad", "0 is needed"],
    ),
    "scene without a name": (
        lambda: Scene(None, [beam()]),
        errors.PropertyError,
        ["scene name", "None", "non-empty string"],
    ),
    "bodies not a list": (lambda: Scene("s", 5), errors.SceneError, ["bodies", "5", "list of Beam"]),
    "velocity no callable": (
        lambda: beam(velocity=(0.0, 1.0)),
        errors.PropertyError,
        ["'a' velocity", "(0.0, 1.0)", "callable"],
    ),
    "force of one value": (
        lambda: at.solve(bar([Clamp("bar.start")], [Force("bar.end", lambda t: t)]), run_of()),
        errors.PropertyError,
        ["'bar.end'", "2 finite", "t = 0.0"],
    ),
    "torque that ends": (
        lambda: tabulate(
            "torque", lambda t: 1.0 / (1.0 - t) if t < 1.0 else inf, np.linspace(0.0, 1.0, 3), 1
        ),
        errors.PropertyError,
        ["torque", "inf", "t = 1.0 s", "finite numbers"],
    ),
}

OPTIONS = {
    "mesh 0": (lambda: run_of(mesh=0), errors.MeshError, ["mesh", "0", "from 1 on"]),
    "mesh a fraction": (lambda: run_of(mesh=2.5), errors.MeshError, ["mesh", "2.5", "whole numbers"]),
    "mesh true": (lambda: run_of(mesh=True), errors.MeshError, ["mesh", "True"]),
    "mesh of a body 0": (lambda: run_of(mesh={"a": 0}), errors.MeshError, ["mesh", "{'a': 0}", "from 1 on"]),
    "mesh misses a body": (
        lambda: run_of(mesh={"a": 1}).of(scene_of()),
        errors.MeshError,
        ["{'a': 1}", "'a', 'b'"],
    ),
    "mesh of a stranger": (
        lambda: run_of(mesh={"a": 1, "b": 1, "c": 1}).of(scene_of()),
        errors.MeshError,
        ["mesh", "'c': 1", "no other"],
    ),
    "element misses a body": (
        lambda: run_of(element={"a": "cable"}).of(scene_of()),
        errors.MeshError,
        ["element", "'a', 'b'"],
    ),
    "unknown element": (
        lambda: run_of(element="rod"),
        errors.UnknownOptionError,
        ["element", "'rod'", "'cable', 'quintic', 'rigid', 'shear'"],
    ),
    "unknown element of a body": (
        lambda: run_of(element={"a": 1}),
        errors.UnknownOptionError,
        ["1", "'cable', 'quintic', 'rigid', 'shear'"],
    ),
    "unknown quadrature": (
        lambda: run_of(quadrature="exact"),
        errors.UnknownOptionError,
        ["quadrature", "'exact'", "'full', 'lobatto', 'reduced'"],
    ),
    "unknown integrator": (
        lambda: run_of(integrator="euler"),
        errors.UnknownOptionError,
        ["integrator", "'euler'", "'generalized-alpha', 'zhai'"],
    ),
    "dt 0": (lambda: run_of(dt=0.0), errors.StepError, ["dt (s)", "0.0", "greater than 0"]),
    "dt nan": (lambda: run_of(dt=nan), errors.StepError, ["dt (s)", "nan", "finite"]),
    "t_end negative": (lambda: run_of(t_end=-1.0), errors.StepError, ["t_end (s)", "-1.0", "greater than 0"]),
    "t_end no whole steps": (
        lambda: run_of(dt=0.3, t_end=1.0),
        errors.StepError,
        ["t_end", "1.0", "whole number of steps dt = 0.3", "such as 0.9"],
    ),
    "t_end below a step": (
        lambda: run_of(dt=1.0, t_end=0.1),
        errors.StepError,
        ["t_end", "0.1", "such as 1.0"],
    ),
    "output_dt no whole steps": (
        lambda: run_of(dt=0.1, output_dt=0.25),
        errors.StepError,
        ["output_dt", "0.25", "whole number", "0.2"],
    ),
    "output_dt 0": (
        lambda: run_of(output_dt=0.0),
        errors.StepError,
        ["output_dt (s)", "0.0", "greater than 0"],
    ),
    "spectral radius": (
        lambda: run_of(spectral_radius=1.1),
        errors.DiscretisationError,
        ["spectral_radius", "1.1", "[0, 1]"],
    ),
    "newton tolerance": (
        lambda: run_of(newton_tolerance=0.0),
        errors.DiscretisationError,
        ["newton_tolerance", "0.0", "(0, 0.01]"],
    ),
    "psi": (lambda: run_of(psi=inf), errors.DiscretisationError, ["psi", "inf", "finite"]),
    "unknown keyword": (
        lambda: at.solve(bar(), mesh=2, colour="red"),
        errors.DiscretisationError,
        ["'colour'", "unknown", "quadrature"],
    ),
    "run and keywords": (
        lambda: at.solve(bar(), run_of(), dt=1.0),
        errors.DiscretisationError,
        ["'dt'", "Discretisation or keywords"],
    ),
    "run of another kind": (lambda: at.solve(bar(), 5), errors.DiscretisationError, ["5", "Discretisation"]),
    "mesh missing": (lambda: at.solve(bar()), errors.MeshError, ["mesh is missing", "needed"]),
    "psi below ½": (
        lambda: at.solve(bar(), run_of(integrator="zhai", dt=1e-6, t_end=1e-6, psi=0.25)),
        errors.StabilityError,
        ["psi is 0.25", "phi is 0.5", "psi = phi >= 0.5", "check_stability=False"],
    ),
    "dt above the limit": (
        lambda: at.solve(bar(), run_of(integrator="zhai", dt=0.1)),
        errors.StabilityError,
        ["dt is 0.1", "at most", "rad/s", "'bar'", "check_stability=False"],
    ),
    "unknown solver": (
        lambda: solver("adams"),
        errors.UnknownSolverError,
        ["'adams'", "anctmm", "global-dae"],
    ),
    "load steps": (
        lambda: at.solve_static(bar(), mesh=1, load_steps=2.5),
        errors.DiscretisationError,
        ["load_steps", "2.5", "whole number from 1 on"],
    ),
    "no probes": (lambda: at.compare(None, None, []), errors.SolverError, ["probes", "at least one"]),
    "mesh text": (lambda: run_of(mesh="8"), errors.MeshError, ["mesh", "'8'", "whole numbers"]),
    "output_dt negative": (
        lambda: run_of(output_dt=-1.0),
        errors.StepError,
        ["output_dt (s)", "-1.0", "greater than 0"],
    ),
    "tolerance 1": (lambda: run_of(tolerance=1.0), errors.StepError, ["tolerance", "1.0", "(0, 0.5)"]),
    "tolerance and dt": (
        lambda: run_of(tolerance=1e-3, dt=1e-3),
        errors.StepError,
        ["dt is 0.001", "tolerance 0.001", "one of them"],
    ),
    "tolerance of an explicit run": (
        lambda: run_of(tolerance=1e-3, integrator="zhai"),
        errors.StepError,
        ["tolerance is 0.001", "'zhai'", "'generalized-alpha' is needed"],
    ),
    "tolerance of a peer": (
        lambda: global_dae.solve(bar(), run_of(tolerance=1e-3)),
        errors.StepError,
        ["tolerance is 0.001", "does not choose its steps", "a fixed dt"],
    ),
    "welded kinds": (
        lambda: at.solve(scene_of(Weld("a.end", "b.start")), run_of(element={"a": "cable", "b": "shear"})),
        errors.DiscretisationError,
        ["'cable' of 'a'", "'shear' of 'b'", "one kind on both sides"],
    ),
    "linear algebra": (
        lambda: global_dae.solve(bar(), run_of(), linear_algebra="qr"),
        errors.UnknownOptionError,
        ["linear_algebra", "'qr'", "'dense-refactor', 'sparse-factored-once'"],
    ),
    "stabilization": (
        lambda: global_dae.solve(bar(), run_of(), stabilization="baumgarte"),
        errors.UnknownOptionError,
        ["stabilization", "'baumgarte'", "'none', 'projection'"],
    ),
    "Exudyn's tolerances": (
        lambda: exudyn_cable.solve(bar(), run_of(), tolerances=(1e-8, -1.0)),
        errors.DiscretisationError,
        ["absolute tolerance", "-1.0", "greater than 0"],
    ),
    "Reissner's order": (
        lambda: exudyn_reissner.solve(bar(), run_of(), order=3),
        errors.DiscretisationError,
        ["order", "3", "1 or 2"],
    ),
    "Exudyn's load steps": (
        lambda: exudyn_cable.solve_static(bar(), mesh=1, load_steps=0),
        errors.DiscretisationError,
        ["load_steps", "0", "from 1 on"],
    ),
    "peer's load steps": (
        lambda: global_dae.solve_static(bar(), mesh=1, load_steps=0),
        errors.DiscretisationError,
        ["load_steps", "0", "whole number from 1 on"],
    ),
}

#: Arguments, and what the one line on standard error must hold; the command ends with code 2.
COMMANDS = {
    "unknown command": (["stud"], ["'stud'", "study"]),
    "unknown option": (["study", "four-bar", "--meshes", "2"], ["--meshes"]),
    "no study": (["study"], ["Missing argument", "name"]),
    "unknown study": (["study", "five-bar"], ["'five-bar'", "four-bar, cantilever"]),
    "mesh of letters": (
        ["study", "four-bar", "--elements", "2/x/2"],
        ["--elements", "'2/x/2'", "2/8/2,4/16/4"],
    ),
    "mesh 0": (["study", "four-bar", "--elements", "8,0"], ["--elements", "'0'", "whole numbers from 1 on"]),
    "mesh of nothing": (["study", "four-bar", "--elements", ""], ["--elements", "''", "whole numbers"]),
    "mesh of half a body": (
        ["study", "four-bar", "--elements", "2//2"],
        ["--elements", "'2//2'", "whole numbers"],
    ),
    "mesh of two bodies": (
        ["study", "four-bar", "--elements", "2/8", "--out", "OUT"],
        ["--elements", "'2/8'", "1 or 3", "crank/coupler/follower"],
    ),
    "step of letters": (
        ["study", "cantilever", "--dt", "fast"],
        ["--dt", "'fast'", "positive numbers of seconds"],
    ),
    "step negative": (["study", "cantilever", "--dt", "1e-3,-1"], ["--dt", "'-1'", "positive"]),
    "step infinite": (["study", "cantilever", "--dt", "inf"], ["--dt", "'inf'", "positive"]),
    "unknown solver": (
        ["study", "cantilever", "--solvers", "anctmm,adams"],
        ["--solvers", "'adams'", "global-dae"],
    ),
    "check of nothing": (["check", "--only", "five-bar"], ["five-bar"]),
    "check by nobody": (["check", "--solver", "adams"], ["adams"]),
    "out is a file": (
        ["study", "cantilever", "--out", "FILE"],
        ["--out", "file'", "File exists", "directory"],
    ),
    "out below a file": (["report", "--out", "FILE/x"], ["--out", "file/x'", "Not a directory", "written"]),
    "bench's out": (
        ["bench", "--quick", "--out", "FILE/x"],
        ["--out", "file/x'", "Not a directory", "written"],
    ),
}

FALL = cantilever_fall()


def case(name="mine", **changes):
    return Trial(
        FALL.scene, **{"solver": name, "mesh": (2,), "dt": 0.05, "t_end": 0.1, "output_dt": 0.05} | changes
    )


def status_of(case, resolve=registry.solver):
    """Code and message of the row of a run."""
    (outcome,) = Runner(None, repeats=1, resolve=resolve).sweep([case])
    made = row(outcome, Reference("none", lambda s: 0.0, 0.0))
    assert np.isnan([made["error"], made["cpu_s"]]).all()
    code, _, message = made["status"].partition(": ")
    return code, message


def without_exudyn(here, **changes):
    here.patch.setitem(sys.modules, "exudyn", None)
    return status_of(case(**changes))


def answering(answer):
    def mine(scene, run):
        return answer()

    return mine


def raising(error):
    def fail(*args, **options):
        raise error

    return fail


def broken_package(here):
    found = [EntryPoint("mine", "no_such_package:solve", registry.GROUP)]
    here.patch.setattr("anctmm.solvers.registry.entry_points", lambda group: found)
    return status_of(case())


def noted(here, call):
    """What is noted while something goes on in spite of a fault."""
    said = []
    here.patch.setattr("anctmm.jit.files.cache_dir.note", said.append)
    call(said.append)
    (text,) = said
    return "note", text


def place(here, cache, home=None, temporary=None):
    """Where kernels are kept under faults; the note says so."""
    storage._once.cache_clear()
    here.patch.setenv("XDG_CACHE_HOME", "")
    here.patch.setenv("ANCTMM_CACHE", cache)
    if temporary is None:
        here.patch.setattr("tempfile.gettempdir", lambda: str(here.path))
    else:
        here.patch.setattr("tempfile.gettempdir", temporary)
    if not cache:
        here.patch.setattr(Path, "home", home)
    return noted(here, lambda note: storage.kept_in("kernels"))


def nowhere(here):
    return place(
        here, str(here.file), temporary=raising(FileNotFoundError(errno.ENOENT, "no temporary directory"))
    )


def no_home(here):
    storage._once.cache_clear()
    here.patch.delenv("ANCTMM_CACHE", raising=False)
    here.patch.delenv("XDG_CACHE_HOME", raising=False)
    here.patch.setattr(Path, "home", raising(RuntimeError("no home")))
    here.patch.setattr("tempfile.gettempdir", lambda: str(here.path))
    assert storage.kept_in("kernels").parent.parent == here.path
    here.patch.setattr("tempfile.gettempdir", raising(FileNotFoundError(errno.ENOENT, "none")))
    return noted(here, lambda note: storage.kept_in("kernels"))


def entry(here, spoil):
    """A finished run whose file is spoilt; it is computed again, and its file is whole again."""
    directory, results = here.path / "runs", iter((np.arange(50.0), np.arange(50.0), None))

    def recall(note):
        return Store(directory, note).remember("key", lambda: next(results))

    recall(print)
    (path,) = directory.glob("*.run")
    whole = path.read_bytes()
    spoil(path, whole)
    told = noted(here, lambda note: np.testing.assert_array_equal(recall(note), np.arange(50.0)))
    assert path.read_bytes() == whole
    np.testing.assert_array_equal(recall(print), np.arange(50.0))
    return told


def full_store(here):
    here.patch.setattr(
        "studies.engine.storage.files.os.fdopen", raising(OSError(errno.ENOSPC, "No space left on device"))
    )
    store = Store(here.path)
    return noted(
        here, lambda note: [setattr(store, "note", note), store.remember("a", int), store.remember("b", int)]
    )


def full_report(here):
    target = here.path / "accuracy.csv"
    atomic_write(target, "old")
    here.patch.setattr("os.replace", raising(OSError(errno.ENOSPC, "No space left on device")))
    try:
        atomic_write(target, "new")
    finally:
        assert target.read_text() == "old"
        assert [p.name for p in here.path.iterdir() if p != here.file] == ["accuracy.csv"]


def unlocked(here):
    here.patch.setattr(
        "studies.engine.storage.store.FileLock.acquire", raising(OSError(errno.ENOLCK, "No locks available"))
    )
    store = Store(here.path)
    return noted(here, lambda note: [setattr(store, "note", note), store.remember("a", int)])


def unpicklable(here):
    store = Store(here.path)
    return noted(here, lambda note: [setattr(store, "note", note), store.remember("a", lambda: lambda: 0)])


def doubled(x):
    return 2.0 * x


def kernel_cache(here, spoil):
    """A kernel whose kept machine code is spoilt, or cannot be kept; it is compiled and works all the same."""
    kernel_files._not_kept.cache_clear()
    here.patch.setattr(kernel_files, "directory", lambda: here.path / "kernels")
    (here.path / "kernels").mkdir()
    assert compiling.kernel(doubled)(2.0) == 4.0
    spoil(here)
    said = []
    here.patch.setattr(kernel_files, "note", said.append)
    assert compiling.kernel(doubled)(2.0) == 4.0
    (text,) = said
    return "note", text


def cut_kernel(here):
    (path,) = (here.path / "kernels").iterdir()
    path.write_bytes(path.read_bytes()[:-20])


def spoil_kernel(place):
    """One bit of a kernel's file is flipped."""

    def spoil(here):
        (path,) = (here.path / "kernels").iterdir()
        content = bytearray(path.read_bytes())
        content[int(place * len(content))] ^= 4
        path.write_bytes(content)

    return spoil


def forget_kernels(here):
    for path in (here.path / "kernels").iterdir():
        path.unlink()
    full = raising(OSError(errno.ENOSPC, "No space left on device"))
    here.patch.setattr(kernel_files, "write_whole", full)


def stored_history(here, spoil):
    """A stored history of `anctmm check` that is not what it was."""
    whole = sorted(BASELINES.rglob("*.csv"))[0].read_bytes()
    path = here.path / "history.csv"
    path.write_bytes(spoil(whole))
    return read_baseline(path)


#: How the environment or a file is spoilt, the error's class or the status or "note", and what the message must hold.
PLACES = {
    "Exudyn missing": (
        lambda here: without_exudyn(here, name="exudyn-cable"),
        "unsupported",
        ["exudyn is not installed", "pip install 'anctmm[peers]'"],
    ),
    "Exudyn missing, Reissner": (
        lambda here: without_exudyn(here, name="exudyn-reissner"),
        "unsupported",
        ["exudyn is not installed", "pip install 'anctmm[peers]'"],
    ),
    "Exudyn missing, statics": (
        lambda here: without_exudyn(here, name="exudyn-cable", integrator="static"),
        "unsupported",
        ["exudyn is not installed", "pip install 'anctmm[peers]'"],
    ),
    "broken package": (broken_package, "refused", ["'mine'", "ModuleNotFoundError", "'no_such_package'"]),
    "solver gone": (
        lambda here: status_of(case("adams")),
        "refused",
        ["'adams'", "not registered", "global-dae"],
    ),
    "answer of another kind": (
        lambda here: status_of(case(), lambda name: answering(lambda: 3.0)),
        "refused",
        ["'mine'", "3.0", "a Solution is needed"],
    ),
    "solver with a bug": (
        lambda here: status_of(
            case(), lambda name: answering(raising(ZeroDivisionError("division by zero")))
        ),
        "failed",
        ["ZeroDivisionError", "division by zero"],
    ),
    "memory": (
        lambda here: status_of(
            case(), lambda name: answering(raising(MemoryError("Unable to allocate 7 TiB")))
        ),
        "failed",
        ["MemoryError", "7 TiB"],
    ),
    "no statics": (
        lambda here: status_of(case(integrator="static"), lambda name: tabulate),
        "refused",
        ["'mine'", "no solve_static", "dynamic scenes only"],
    ),
    "mesh for other bodies": (
        lambda here: status_of(case("anctmm", mesh=(2, 8))),
        "refused",
        ["mesh 2/8", "2 numbers", "needs 1"],
    ),
    "cache not writable": (
        lambda here: place(here, str(here.file)),
        "note",
        ["file", "cannot be written", "Not a directory", "is used instead", "ANCTMM_CACHE"],
    ),
    "no place at all": (
        nowhere,
        "note",
        ["file", "cannot be written", "kernels are not stored", "ANCTMM_CACHE"],
    ),
    "no home": (no_home, "note", ["kernels are not stored", "ANCTMM_CACHE"]),
    "kernel cut": (
        lambda here: kernel_cache(here, cut_kernel),
        "note",
        ["doubled", "checksum is wrong", "compiled again"],
    ),
    "bit of a kernel's machine code": (
        lambda here: kernel_cache(here, spoil_kernel(0.7)),
        "note",
        ["doubled", "checksum is wrong", "compiled again"],
    ),
    "bit of a kernel's checksum": (
        lambda here: kernel_cache(here, spoil_kernel(0.001)),
        "note",
        ["doubled", "checksum is wrong", "compiled again"],
    ),
    "no room for kernels": (
        lambda here: kernel_cache(here, forget_kernels),
        "note",
        ["kernels cannot be stored", "No space left", "next run compiles them again"],
    ),
    "run cut": (
        lambda here: entry(here, lambda path, whole: path.write_bytes(whole[:-100])),
        "note",
        [".run", "not readable", "truncated", "computed again"],
    ),
    "run empty": (
        lambda here: entry(here, lambda path, whole: path.write_bytes(b"")),
        "note",
        [".run", "not readable", "truncated", "computed again"],
    ),
    "run of garbage": (
        lambda here: entry(here, lambda path, whole: path.write_bytes(os.urandom(len(whole)))),
        "note",
        [".run", "not readable", "computed again"],
    ),
    "run with a flipped bit": (
        lambda here: entry(here, lambda path, whole: path.write_bytes(whole[:-200] + b"!" + whole[-199:])),
        "note",
        [".run", "not readable", "computed again"],
    ),
    "run of another digest": (
        lambda here: entry(here, lambda path, whole: path.write_bytes(MAGIC + 32 * b"0")),
        "note",
        [".run", "not readable", "computed again"],
    ),
    "no room for runs": (
        full_store,
        "note",
        ["cannot be stored", ".run", "No space left", "continues without"],
    ),
    "no locks": (
        unlocked,
        "note",
        ["cannot be locked", "No locks available", "two sessions may repeat runs"],
    ),
    "result of no file": (unpicklable, "note", ["cannot be stored", "lambda", "computed each time"]),
    "foreign CSV": (
        lambda here: stored_history(here, lambda whole: b"t,x\n0,1\n"),
        CheckError,
        ["history.csv", "does not begin with", "no history stored by anctmm check"],
    ),
    "CSV of another tongue": (
        lambda here: stored_history(here, lambda whole: b"\xff\xfe\x00"),
        CheckError,
        ["history.csv", "does not begin with"],
    ),
    "CSV cut": (
        lambda here: stored_history(here, lambda whole: whole[: len(whole) // 2]),
        CheckError,
        ["history.csv", "cut short", "rows", "are needed", "--update"],
    ),
    "CSV with a word for a number": (
        lambda here: stored_history(here, lambda whole: b"x".join(whole.rsplit(b"0.", 1))),
        CheckError,
        ["history.csv", "cannot be read", "--update"],
    ),
    "no room for a table": (full_report, errors.OutputError, ["accuracy.csv", "No space left", "3 bytes"]),
    "table below a file": (
        lambda here: atomic_write(here.file / "x" / "a.csv", "1"),
        errors.OutputError,
        ["a.csv", "Not a directory", "is needed"],
    ),
    "out below a file": (
        lambda here: check_writable(here.file / "out"),
        errors.OutputError,
        ["--out", "out'", "Not a directory", "is needed"],
    ),
}


def by_exception(make, here):
    """Class and message of what is raised, or what is answered in its place."""
    try:
        return make(here)
    except errors.AnctmmError as error:
        return type(error), str(error)


def by_command(arguments, here):
    """Exit code and what the command says."""
    places = {"FILE": str(here.file), "FILE/x": str(here.file / "x"), "OUT": str(here.path)}
    done = CliRunner().invoke(app, [places.get(a, a) for a in arguments])
    assert done.exception is None or isinstance(done.exception, SystemExit)
    assert "Traceback" not in done.output
    return done.exit_code, " ".join(re.sub("[│╭╮╰╯─]", " ", done.stderr).split())


CASES = {
    **{
        f"scene: {k}": (lambda here, v=v: by_exception(lambda _: v[0](), here), *v[1:])
        for k, v in SCENES.items()
    },
    **{
        f"options: {k}": (lambda here, v=v: by_exception(lambda _: v[0](), here), *v[1:])
        for k, v in OPTIONS.items()
    },
    **{f"command: {k}": (lambda here, v=v: by_command(v[0], here), 2, v[1]) for k, v in COMMANDS.items()},
    **{f"place: {k}": (lambda here, v=v: by_exception(v[0], here), *v[1:]) for k, v in PLACES.items()},
}


class Here:
    """An empty directory, a file in it that is no directory, and pytest's monkeypatch."""

    def __init__(self, path, patch):
        self.path, self.patch, self.file = path, patch, path / "file"
        self.file.write_text("")


@pytest.mark.parametrize("what", CASES)
def test_what_is_wrong_is_told(what, tmp_path, monkeypatch):
    make, kind, words = CASES[what]
    found, message = make(Here(tmp_path, monkeypatch))
    assert found == kind
    assert [w for w in words if w not in message] == []
    assert "\n" not in message


def test_the_table_is_long_and_its_categories_are_full():
    counts = [len(table) for table in (SCENES, OPTIONS, COMMANDS, PLACES)]
    assert min(counts) >= 15
    assert sum(counts) >= 120


@pytest.mark.interpreted
def test_without_exudyn_the_others_run(monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    both = [case("exudyn-cable"), case("anctmm")]
    outcomes = Runner(None, repeats=1).sweep(both)
    assert [o.solution.status.code for o in outcomes] == ["unsupported", "ok"]


def test_a_home_that_cannot_be_written_does_not_stop_a_run(tmp_path):
    """A user without home and cache, for real: another process."""
    (tmp_path / "file").write_text("")
    (tmp_path / "tmp").mkdir()
    code = "from anctmm.jit.compiler.kernel_files import directory; print(directory())"
    environment = {**os.environ, "ANCTMM_CACHE": str(tmp_path / "file"), "TMPDIR": str(tmp_path / "tmp")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.startswith(str(tmp_path / "tmp"))
    assert done.stderr.count("\n") == 1
    assert "cannot be written" in done.stderr


@pytest.fixture
def tiny_disk(tmp_path):
    """A file system of 64 kB, where the user may make one."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    try:
        done = subprocess.run(mount, capture_output=True, check=False).returncode
    except OSError:
        done = 1
    if done != 0:
        pytest.skip("this user may not mount a file system")
    yield place
    subprocess.run(["umount", str(place)], capture_output=True, check=True)


def test_a_full_disk_keeps_what_it_has(tiny_disk):
    said = []
    store = Store(tiny_disk / "runs", said.append)
    assert store.remember("small", lambda: b"kept") == b"kept"
    large = np.random.default_rng(0).bytes(200_000)
    for _ in range(2):
        assert store.remember("large", lambda: large) == large
    assert len(said) == 1
    assert "No space left on device" in said[0]
    assert store.remember("small", lambda: b"computed again") == b"kept"
    atomic_write(tiny_disk / "table.csv", "old")
    with pytest.raises(errors.OutputError, match=r"No space left on device.*200000 bytes"):
        atomic_write(tiny_disk / "table.csv", large)
    assert (tiny_disk / "table.csv").read_text() == "old"
    assert sorted(p.name for p in tiny_disk.iterdir()) == ["runs", "table.csv"]


def test_errors_are_also_pythons_own():
    for ours, python in [
        (errors.SceneError, ValueError),
        (errors.DiscretisationError, ValueError),
        (errors.UnknownNameError, KeyError),
        (errors.SolverError, RuntimeError),
        (errors.OutputError, OSError),
    ]:
        assert issubclass(ours, errors.AnctmmError)
        assert issubclass(ours, python)
