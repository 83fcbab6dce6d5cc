"""The gallery: each file runs as it stands and gives the value that is known; the page shows it."""

import pytest

from studies.cases import cases_in
from studies.gallery.__main__ import PAGE, PICTURES, SCENES, scenes, section, solved

EVERY = scenes()
PAGE_TEXT = PAGE.read_text(encoding="utf-8")


def test_every_file_is_a_case_on_the_page_with_its_picture():
    assert {p.stem for p in PICTURES.iterdir()} == set(EVERY)
    for name in EVERY:
        assert f"scenes/{name}.py" in PAGE_TEXT
        assert len(cases_in(SCENES / f"{name}.py")) == 1


@pytest.mark.parametrize("name", EVERY)
def test_a_scene_gives_the_value_that_is_known(name):
    found = solved(EVERY[name])
    what, value, known, tolerance, *_ = EVERY[name]["known"](found)
    assert abs(value - known) <= tolerance, what
    title, _, rest = section(name, EVERY[name], found).partition("\n")
    assert title in PAGE_TEXT
    assert rest.rpartition("; known: ")[2].strip() in PAGE_TEXT
