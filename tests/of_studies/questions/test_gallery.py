"""The gallery: short scripts that run, pictures of these scripts, and numbers that are known."""

import re
from contextlib import nullcontext

import pytest

from anctmm.jit.interpreting import interpreted
from studies.cases import cases_in
from studies.gallery.entry import PICTURES, SCENES, Number, Script
from studies.gallery.page import ENTRIES, PAGE, drawn, section

#: Lines of a script at most, and bytes of all pictures.
LINES, BYTES = 25, 1_500_000
#: Of few elements and steps: Python runs their kernels as soon as they would be compiled.
FEW = ("straight_line", "half_car", "snap_through", "bridge")
EVERY = [
    pytest.param(entry, id=entry.name, marks=() if entry.name in FEW else pytest.mark.exhaustive)
    for entry in ENTRIES
]


def test_there_are_a_dozen_and_each_file_is_shown_once():
    assert len(ENTRIES) >= 12
    assert sorted(p.stem for p in SCENES.glob("*.py")) == sorted(e.name for e in ENTRIES)
    assert sorted(p.stem for p in PICTURES.iterdir()) == sorted(e.name for e in ENTRIES)
    assert sum(p.stat().st_size for p in PICTURES.iterdir()) < BYTES


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_a_script_is_short_and_its_picture_was_made_of_it(entry):
    script = Script(entry.name)
    text = script.path.read_text(encoding="utf-8")
    assert text.count("\n") <= LINES
    assert max(map(len, text.splitlines())) <= 110
    assert text.startswith('"""')
    assert [case.name for case in cases_in(script.path)] == [script.case.name]
    svg = entry.picture.read_text(encoding="utf-8")
    assert script.digest in svg  # else: python -m studies.gallery
    assert "<text" not in svg  # letters are outlines: a page that shows it has no fonts for it
    page = PAGE.read_text(encoding="utf-8")
    assert all(part in page for part in (f"## {entry.title}\n", entry.text, f"pictures/{entry.name}.svg"))


@pytest.mark.parametrize("entry", EVERY)
def test_a_scene_ends_well_and_gives_the_number_that_is_known(entry):
    script = Script(entry.name)
    with interpreted() if entry.name in FEW else nullcontext():
        found = entry.solve(script)  # raises unless the status is ok
        number = entry.number(script, found)
    assert number.met, number
    written = section(entry, number)
    (line,) = (x for x in written.splitlines() if "; known: " in x)
    page = PAGE.read_text(encoding="utf-8")
    assert line.partition(": ")[0] in page
    assert line.partition("; known: ")[2] in page
    svg = drawn(entry, script, found).svg
    stored = entry.picture.read_text(encoding="utf-8")
    assert len(drawing(svg)) == len(drawing(stored))


def drawing(svg):
    """What a picture is made of: its groups, without coordinates."""
    return re.findall(r'<g id="([a-z]+)_', svg)


def test_a_number_that_differs_is_not_met():
    given = {"what": "x", "unit": "m", "known": 1.0, "tolerance": 1e-3, "source": ""}
    assert Number(found=1.0009, **given).met
    assert not Number(found=1.0011, **given).met
    assert not Number(found=float("nan"), **given).met


def test_a_run_that_does_not_end_well_is_told():
    from anctmm.errors import SolverError
    from studies.gallery.equilibria import rest
    from studies.gallery.motions import run

    with interpreted(), pytest.raises(SolverError, match="column"):
        rest(Script("column")["column"](1e-4, load=2.0), mesh=4)
    with interpreted(), pytest.raises(SolverError, match="soft_pendulum: diverged"):
        run(Script("soft_pendulum"), mesh=2, dt=1e-2, integrator="zhai", check_stability=False)
