"""What the README says of the kept trade is what its table says: one claim, told once."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
SCENES = "four-bar", "cantilever-fall"
TARGETS = 1e-2, 1e-3, 1e-4, 1e-5


@pytest.fixture(scope="module")
def trade():
    """Cost of an error by each kind, and how many times the cheapest one's it is."""
    return pd.read_csv(ROOT / "reports" / "trade" / "by_rival.csv")


def dearer(trade, scene, target, rival):
    """How many times more implicit steps of cables cost by a rival, at exactly that error."""
    mine = trade[(trade["scene"] == scene) & (trade["target_error"] == target)]
    implicit = mine[(mine["element"] == "cable") & (mine["stepping"] == "implicit")].set_index("solver")
    return implicit.loc[rival, "cpu_s_at_error"] / implicit.loc["anctmm", "cpu_s_at_error"]


@pytest.mark.parametrize(("rival", "name"), [("exudyn-cable", "Exudyn"), ("global-dae", "sparse global DAE")])
def test_the_readme_tells_the_ratios_of_the_trade(trade, rival, name):
    """In the rows "implicit, each at its best …", for each scene from the smallest to the largest ratio."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (row,) = re.findall(
        rf"^\| implicit, each at its best .*: {name} / ANC–TMM.*\| ([^|]*) \|$", readme, re.MULTILINE
    )
    told = [tuple(float(x) for x in part.split("…")) for part in row.split(";")]
    for scene, (least, most) in zip(SCENES, told, strict=True):
        found = [dearer(trade, scene, target, rival) for target in TARGETS]
        assert (f"{min(found):.2g}", f"{max(found):.2g}") == (f"{least:.2g}", f"{most:.2g}")
