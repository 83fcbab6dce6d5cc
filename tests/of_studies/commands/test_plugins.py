"""Other people's solvers: the page's template installed as a package, and packages that are broken."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import PluginError
from anctmm.solvers import registry
from studies.command_line.options import solver
from studies.conformance.check import BROKEN, conform
from studies.engine.runner import Runner
from studies.engine.trials import Trial
from studies.scenes import cantilever_fall

README = (Path(__file__).parents[3] / "anctmm/solvers/README.md").read_text(encoding="utf-8")
FALL = cantilever_fall()
RUN = Discretisation(mesh=4, dt=1e-2, t_end=0.1)

#: Packages by the name of their solver: module, what it is registered as, and what is said about it.
BROKEN_PACKAGES = {
    "raises": ('raise RuntimeError("no licence")', "raises:solve",
               "solver 'raises' of package raises (raises:solve) cannot be loaded: RuntimeError: no licence"),
    "absent": ("", "absent:solve", "cannot be loaded: AttributeError: module 'absent' has no attribute 'solve'"),
    "number": ("solve = 3", "number:solve", "(number:solve) is 3; a function (scene, run) is needed"),
    "nothing": ("def solve(scene, run): pass", "nothing:solve",
                "solver 'nothing' answers scene 'cantilever-fall' with a NoneType; an anctmm.Solution is needed"),
    "nan": ("solve = changed(lambda p: p * float('nan'))", "nan:solve",
            "solver 'nan' answers scene 'cantilever-fall' with positions of body 'beam' that are not finite"),
    "flat": ("solve = changed(lambda p: p[:, 0])", "flat:solve", "positions of body 'beam' of shape ("),
    "bodiless": ("solve = changed(lambda p: p, 'bream')", "bodiless:solve", "no field of body 'beam'"),
    "backwards": ("solve = changed(lambda p: p, t=-1.0)", "backwards:solve", "times that do not increase"),
    "worded": ("solve = changed(lambda p: p, status='fine')", "worded:solve", "the status 'fine'; an anctmm.Status"),
}  # fmt: skip
#: Put before those modules: a solution with one thing changed.
PRELUDE = """
from dataclasses import dataclass, replace
from typing import Any
import anctmm as at

@dataclass
class Moved:
    of: Any
    change: Any

    def position(self, fraction):
        return self.change(self.of.position(fraction))

def changed(change, body="beam", t=1.0, **things):
    def solve(scene, run):
        answer = at.solve(scene, run)
        fields = {body: Moved(field, change) for field in answer.fields.values()}
        return replace(answer, fields=fields, t=t * answer.t, **things)
    return solve
"""


def package(folder, name, module, solvers):
    """Install a package as pip leaves it: its module and its metadata."""
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.py").write_text(module)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"{solver} = {value}" for solver, value in solvers.items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{registry.GROUP}]", *lines, ""]))


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A directory of packages on the path; modules imported from it are forgotten."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    before = set(sys.modules)
    yield folder
    for name in set(sys.modules) - before:
        if Path(getattr(sys.modules[name], "__file__", None) or "/").parent == folder:
            del sys.modules[name]


@pytest.fixture
def ballistic(site):
    """The page's template as an installed package."""
    (module,) = re.findall(r"```python\n(import numpy.*?)```", README, re.DOTALL)
    (toml,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    package(site, "ballistic", module, tomllib.loads(toml)["project"]["entry-points"][registry.GROUP])
    return site


def broken(site, *names):
    for name in names or BROKEN_PACKAGES:
        module, value, _ = BROKEN_PACKAGES[name]
        package(site, name, PRELUDE + module if "changed" in module else module, {name: value})


def command(site, *arguments):
    paths = [str(site), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "250"}
    line = [sys.executable, "-m", "studies", *arguments]
    return subprocess.run(line, env=environment, capture_output=True, text=True, check=False)


def test_the_template_is_a_solver(ballistic):
    assert "ballistic" in registry.names()
    assert solver("ballistic") == "ballistic"
    found = registry.solver("ballistic")(FALL.scene, RUN)
    np.testing.assert_allclose(found.displacement("beam.end")[:, 1], -0.5 * 9.81 * found.t**2, atol=1e-15)


def test_the_template_stands_in_the_list_beside_a_broken_one_which_conform_names(ballistic):
    broken(ballistic, "raises")
    done = command(ballistic, "list")
    assert done.returncode == 0, done.stderr
    lines = {line.split()[0]: line for line in done.stdout.splitlines() if line.strip()}
    assert "ballistic: ballistic:solve" in lines["ballistic"]
    assert "damping, drives, energy, generalized-alpha, joints, rigid, statics" in lines["ballistic"]
    assert "broken: solver 'raises' of package raises" in lines["raises"]
    done = command(ballistic, "conform", "raises")
    assert (done.returncode, "no licence" in done.stdout) == (1, True)


def test_the_check_stores_and_compares_its_histories_and_names_the_broken_ones(ballistic, tmp_path):
    broken(ballistic, "raises")
    where = ["--only", "cantilever-fall/cable-implicit", "--baselines", str(tmp_path / "stored")]
    asked = ["check", *where, "--out", str(tmp_path / "out"), "--solver"]
    assert command(ballistic, *asked, "ballistic", "--update").returncode == 0
    (stored,) = (tmp_path / "stored").rglob("ballistic.csv")
    done = command(ballistic, *asked, "ballistic")
    assert (done.returncode, "ballistic" in done.stdout) == (0, True), done.stdout
    stored.write_text(stored.read_text().replace("-1.22625", "-1.22626"))  # the fall after 0.5 s, m
    assert command(ballistic, *asked, "ballistic").returncode == 1
    done = command(ballistic, *asked, "raises")
    assert (done.returncode, "no licence" in done.stdout) == (4, True)


def test_each_solver_has_a_row_and_the_broken_ones_their_reason(ballistic):
    broken(ballistic)
    common = {"dt": 1e-2, "t_end": 0.1, "output_dt": 0.01}
    explicit = Trial(FALL.scene, "ballistic", (4,), integrator="zhai", **common)
    trials = [explicit, *(Trial(FALL.scene, name, (4,), **common) for name in ("anctmm", *BROKEN_PACKAGES))]
    found = dict(zip([t.solver for t in trials], Runner().solve_many(trials), strict=True))
    assert found["anctmm"].status.ok
    assert found["ballistic"].status.ok
    for name, (_, _, reason) in BROKEN_PACKAGES.items():
        assert not found[name].status.ok
        assert reason in str(found[name].status)


def test_no_package_takes_our_names_and_two_cannot_share_one(ballistic, tmp_path, monkeypatch):
    names = {"anctmm": "thief:solve", "ballistic": "thief:solve"}
    package(ballistic, "thief", "def solve(scene, run): pass", names)
    assert registry.load("anctmm").__module__ == "anctmm.solve"
    with pytest.raises(
        PluginError, match=r"'ballistic' is registered by (ballistic|thief) and (ballistic|thief)"
    ):
        registry.solver("ballistic")


def test_an_offer_that_is_none_is_named(site):
    package(site, "boaster", "OFFER = 'all'\ndef solve(scene, run): pass", {"boaster": "boaster:solve"})
    (finding,) = conform("boaster")
    assert (finding.rule, finding.verdict) == ("loads", BROKEN)
    assert (
        "OFFER of module 'boaster' is 'all'; an anctmm.solvers.capabilities.Offer is needed"
        in finding.measured
    )


def test_a_stored_answer_is_not_that_of_an_edited_plug_in(ballistic, tmp_path):
    case = Trial(FALL.scene, "ballistic", (4,), integrator="zhai", dt=1e-2, t_end=0.1, output_dt=0.01)
    key = Runner(tmp_path / "runs").key(case)
    assert key
    assert Runner(tmp_path / "runs").key(case) == key
    (ballistic / "ballistic.py").write_text((ballistic / "ballistic.py").read_text().replace("0.5", "0.25"))
    del sys.modules["ballistic"]  # as in a new process
    assert Runner(tmp_path / "runs").key(case) != key
