"""A kept result is that of the code that made it: what is edited is computed again, and nothing else is."""

import importlib
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from anctmm.model.scene import Clamp
from anctmm.results.fields import LagrangeField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from studies.engine.runner import Runner
from studies.engine.running.case_text import case_key, classes, reproducible
from studies.engine.running.trial import Trial
from studies.engine.storage import provenance
from studies.engine.storage.sources import Sources, module_of
from studies.scenes import cantilever_fall, four_bar

#: A package of several files that import one another in every way the language has.
PACKAGE = {
    "__init__.py": "from mine.public import shown\n",
    "public.py": "shown = 1\n",
    "root.py": """
import json
from typing import TYPE_CHECKING

import mine.plain
import mine.renamed as other
from mine import submodule, shown
from mine.names import value as renamed_value
from . import sibling
from .deeper.leaf import grown
from mine.starred import *

if TYPE_CHECKING:
    from mine.types_only import Kind


def compute():
    from mine import inner
    from importlib import import_module
    import_module("mine.by_name")
    return inner.number


class Law:
    def __call__(self):
        return compute()

    def method(self):
        return 1
""",
    "plain.py": "", "renamed.py": "", "submodule.py": "", "names.py": "import mine.indirect\nvalue = 1\n",
    "indirect.py": "from mine import root\n", "sibling.py": "", "starred.py": "", "inner.py": "number = 1\n",
    "by_name.py": "", "types_only.py": "", "stranger.py": "", "deeper/__init__.py": "",
    "deeper/leaf.py": "from .. import lifted\ngrown = 1\n", "lifted.py": "",
}  # fmt: skip
UNUSED = {"types_only.py", "stranger.py", "deeper/__init__.py"}


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """That package, on the path; forgotten afterwards."""
    folder = tmp_path / "mine"
    for name, text in PACKAGE.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    forget()


def forget():
    for name in [n for n in sys.modules if n.partition(".")[0] == "mine"]:
        del sys.modules[name]
    importlib.invalidate_caches()


@pytest.mark.parametrize("name", PACKAGE)
def test_an_edit_of_what_is_imported_changes_the_hash_and_no_other_does(mine, name):
    before = Sources().digest("mine.root")
    (mine / name).write_text(PACKAGE[name] + "\nedited = 1\n")
    assert (Sources().digest("mine.root") != before) == (name not in UNUSED)


def test_a_callable_is_of_its_module_however_it_is_wrapped(mine):
    root = importlib.import_module("mine.root")
    calls = [root.compute, partial(partial(root.compute), 1), root.Law(), root.Law().method]
    assert [module_of(call) for call in calls] == ["mine.root"] * 4
    assert len({Sources().of(call) for call in calls}) == 1


def test_what_has_no_source_has_no_hash():
    space: dict = {"__name__": "<nowhere>"}
    exec("def compute(): return 1", space)
    assert Sources().of(space["compute"]) is None
    computed = []
    for _ in range(2):
        assert Runner(None).remember("key", lambda: computed.append(1)) is None
    assert len(computed) == 2


def test_a_result_is_kept_until_its_code_is_edited(mine, tmp_path):
    def recall():
        forget()
        root = importlib.import_module("mine.root")
        return Runner(tmp_path / "runs").remember("key", root.compute)

    assert recall() == 1
    (mine / "inner.py").write_text("number = 2  # edited\n")
    assert recall() == 2
    (mine / "inner.py").write_text("number = 3\n")
    assert recall() == 3
    (mine / "stranger.py").write_text("anything = 1\n")
    (mine / "inner.py").write_text("number = 2  # edited\n")
    assert len(list((tmp_path / "runs").glob("*.run"))) == 3
    assert recall() == 2
    assert len(list((tmp_path / "runs").glob("*.run"))) == 3


def test_nothing_is_kept_without_a_source_or_a_key(tmp_path):
    space: dict = {"__name__": "<nowhere>"}
    exec("def compute(): return 1", space)
    runner = Runner(tmp_path / "runs")
    assert runner.remember("key", space["compute"]) == 1
    assert runner.remember("", lambda: 2) == 2
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("module", "own"),
    [
        ("studies.cantilever.force_cost", ["anctmm.elements.shear_kernel", "anctmm.elements.invariants"]),
        ("studies.fidelity.study", ["anctmm.integrators.zhai", "anctmm.integrators.stability"]),
        ("studies.extremes.length", ["studies.extremes.parts", "anctmm.recursion.riccati"]),
        ("studies.extremes.step", ["studies.extremes.march", "anctmm.integrators.stability"]),
        ("studies.extremes.time", ["anctmm.integrators.generalized_alpha", "reference.global_dae.constraints"]),
        ("studies.trade.study", ["studies.engine.measuring.clock"]),
        ("studies.four_bar.paper_table", ["studies.engine.measuring.timing"]),
        ("studies.engine.runner", ["studies.engine.measuring.timing", "anctmm.results.solution"]),
    ],
)  # fmt: skip
def test_the_studies_results_are_those_of_their_own_code(module, own):
    found = Sources().modules(module)
    assert [name for name in (module, *own) if name not in found] == []


def test_editing_a_picture_repeats_no_run():
    sources = Sources()
    for module in ("studies.engine.runner", "anctmm.solve", "reference.global_dae", "reference.exudyn.cable"):
        assert not any(name.startswith("studies.report") for name in sources.modules(module))
    assert "reference.global_dae" not in sources.modules("anctmm.solve")
    assert "reference.pyelastica.model" in sources.modules("reference.pyelastica")
    assert sources.modules("anctmm.solve")["numba"] == provenance.versions()["numba"]


# --- keys of runs --------------------------------------------------------------------------------------------

FALL = cantilever_fall()


def case(**changes):
    return Trial(FALL.scene, "anctmm", (2,), integrator="zhai", dt=1e-2, t_end=0.1, output_dt=0.01, **changes)


#: A drive that reads a file: where it is made, where its module is imported, and where it is called.
READING = """
from dataclasses import dataclass, field
from pathlib import Path

FILE = Path(__file__).with_name("drive.txt")
READ = float(FILE.read_text())


@dataclass(frozen=True)
class Made:
    file: str
    rate: float = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "rate", float(FILE.read_text()))

    def __call__(self, t):
        return self.rate * t * t, 2 * self.rate * t, 2 * self.rate


@dataclass(frozen=True)
class Imported:
    def __call__(self, t):
        return READ * t * t, 2 * READ * t, 2 * READ


@dataclass(frozen=True)
class Called:
    def __call__(self, t):
        rate = float(FILE.read_text())
        return rate * t * t, 2 * rate * t, 2 * rate
"""


@pytest.mark.parametrize("drive", ["Made('drive.txt')", "Imported()", "Called()"])
def test_no_run_is_kept_whose_drive_may_read_a_file(mine, drive, tmp_path):
    """With another file the scene moves otherwise, and was told to move as before."""
    (mine / "reading.py").write_text(READING)
    moved = []
    for rate in ("0.1", "0.2"):
        (mine / "drive.txt").write_text(rate)
        forget()
        turn = eval(drive, vars(importlib.import_module("mine.reading")))
        crank = replace(FALL.scene, joints=(Clamp("beam.start", angle=turn),), gravity=(0.0, 0.0))
        runner = Runner(tmp_path / "runs", resolve=lambda name: turned)
        moved.append(runner.solve(replace(case(), scene=crank)).solution.position("beam", 1.0)[-1, 1])
        assert (runner.computed, runner.forgotten) == (0, 1)
    assert moved == [0.1, 0.2]


def turned(scene, run):
    """A solver whose beam ends as high as its drive has turned after 1 s."""
    turn = scene.joints[0].angle(1.0)[0]
    path = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, turn]]])
    fields = {"beam": LagrangeField(path)}
    return Solution("turned", scene, run, np.array([0.0, 1.0]), fields, Energy.unknown(2), Cost(), Status())


def test_what_a_case_is_made_of_is_told_in_full():
    assert reproducible(replace(four_bar().scene, name="other"))
    assert classes(four_bar().scene) >= {"anctmm.model.scene", "anctmm.model.drives", "anctmm.model.sections"}
    near = case(options=(("a", 0.1),)), case(options=(("a", 0.1 + 2**-56),))
    assert len({case_key(c) for c in near}) == 2
