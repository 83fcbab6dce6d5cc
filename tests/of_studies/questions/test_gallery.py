"""The gallery: each file runs as it stands and gives the value that is known; the page shows it."""

import pytest

from anctmm.errors import SolverError
from studies.cases import cases_in
from studies.gallery.page import PAGE, PICTURES, SCENES, picture, scenes, section, solved

EVERY = scenes()
LINES = 45


def test_every_file_is_on_the_page_with_its_picture():
    page = PAGE.read_text(encoding="utf-8")
    assert len(EVERY) >= 12
    assert {p.stem for p in PICTURES.iterdir()} == set(EVERY)
    assert sum(p.stat().st_size for p in PICTURES.iterdir()) < 600_000
    for name in EVERY:
        assert f"scenes/{name}.py" in page
        assert (SCENES / f"{name}.py").read_text(encoding="utf-8").count("\n") <= LINES
        assert len(cases_in(SCENES / f"{name}.py")) == 1


@pytest.mark.parametrize("name", EVERY)
def test_a_scene_gives_the_value_that_is_known(name):
    found = solved(EVERY[name])
    what, value, known, tolerance, *_ = EVERY[name]["known"](found)
    assert abs(value - known) <= tolerance, what
    stored = PAGE.read_text(encoding="utf-8")
    head, _, rest = section(name, EVERY[name], found).partition(": ")
    assert head.splitlines()[0] in stored
    assert rest.rpartition("; known: ")[2].strip() in stored
    assert picture(EVERY[name], found).axes


def test_a_run_that_does_not_end_well_is_named():
    names = {**EVERY["soft_pendulum"]}
    names["RUN"] = {"mesh": 2, "dt": 1e-2, "integrator": "zhai", "check_stability": False}
    with pytest.raises(SolverError, match="soft-pendulum: diverged"):
        solved(names)
