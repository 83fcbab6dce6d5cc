"""No text of a picture lies on another, with all that the kept tables hold."""

from pathlib import Path

import pandas as pd
import pytest
from browser import OVERLAPS, Tab, needs_chromium

from studies.report.error_pictures import ELEMENT_TITLES, RULE_SHADES, over_mesh, styled
from studies.report.plots import SOLVER_COLOURS
from studies.trade.pictures import pictures

REPORTS = Path(__file__).parents[3] / "reports"


def drawn():
    points = pd.read_csv(REPORTS / "trade" / "points.csv")
    for scene, mine in points.groupby("scene", sort=False):
        yield from pictures(scene, mine)
    for study, scene in (("four-bar", "four-bar"), ("cantilever", "cantilever-fall")):
        rows = pd.read_csv(REPORTS / study / "accuracy.csv")
        rows = rows[rows["scene"] == scene]
        known = rows["element"].where(rows["element"].isin(list(ELEMENT_TITLES)), "cable")
        elements = rows["elements"].astype(str).str.split("/").map(lambda mesh: sum(map(int, mesh)))
        yield over_mesh(rows.assign(family=known, all_elements=elements), f"mesh_{study}")


#: Ends of texts that lie outside of the picture, px.
OUTSIDE = """
const room = document.querySelector("svg").getBoundingClientRect();
return [...document.querySelectorAll("svg text, svg g[id^=text]")].filter(t => t.textContent.trim()).map(t => {
  const box = t.getBoundingClientRect();
  return [t.textContent.trim(), Math.min(box.left - room.left, box.top - room.top, room.right - box.right,
                                          room.bottom - box.bottom)];
}).filter(([, free]) => free < -1);
"""


@needs_chromium
@pytest.mark.parametrize("meshes", [1, 2])
def test_a_map_of_few_meshes_has_room_for_its_words(browser, tmp_path, meshes):
    points = pd.read_csv(REPORTS / "trade" / "points.csv")
    points = points[(points["scene"] == "four-bar") & (points["family"] == "cable")]
    few = points[points["elements"].isin(sorted(points["elements"].unique())[:meshes])]
    (shown,) = [p for p in pictures("four-bar", few) if p.name.startswith("mesh_step")]
    page = tmp_path / "map.html"
    page.write_text(f"<!doctype html><meta charset='utf-8'>{shown.svg[shown.svg.index('<svg') :]}")
    tab = Tab(browser, page)
    assert tab.run(OUTSIDE) == []
    tab.close()


def test_a_front_below_the_uncertainty_of_its_reference_has_room_for_the_words():
    """They stood far above the axes, for which no room was left: Matplotlib warns of that, an error here."""
    points = pd.read_csv(REPORTS / "trade" / "points.csv")
    two = points[(points["scene"] == "four-bar") & (points["family"] == "cable") & (points["dt"] > 0.0)][:2]
    below = two.assign(error=6e-5, robust_error=[6.00e-5, 6.01e-5], reference_error=1.2e-4)
    assert len(pictures("four-bar", below)) >= 1


@needs_chromium
def test_texts_of_pictures_have_room(browser, tmp_path):
    for shown in drawn():
        page = tmp_path / f"{shown.name}.svg.html"
        page.write_text(f"<!doctype html><meta charset='utf-8'>{shown.svg[shown.svg.index('<svg') :]}")
        tab = Tab(browser, page)
        assert tab.run(OVERLAPS) == [], shown.name
        tab.close()


def test_a_solver_and_a_quadrature_have_one_colour_that_no_other_has():
    """Reduced quadrature had one colour for all solvers, and that of OpenSees."""
    rows = pd.DataFrame(
        [
            {
                "solver": solver, "quadrature": rule, "integrator": "generalized-alpha", "dt": 0.1,
                "elements": "4", "element": "cable", "error": 0.1, "cpu_s": 1.0,
            }
            for solver in SOLVER_COLOURS
            for rule in ("full", *RULE_SHADES)
        ]
    )  # fmt: skip
    assert styled(rows)["colour"].is_unique
