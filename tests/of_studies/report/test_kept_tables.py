"""What the READMEs say of the kept tables is what these say, and two measurements of one claim agree."""

import re
from pathlib import Path

import pandas as pd
import pytest

from studies.trade.recommendation.recommend import choose, kept
from studies.trade.tables import recommended

ROOT = Path(__file__).parents[3]
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
    """In the rows "implicit, each solver at its best …", for each scene from the smallest to the largest ratio."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (row,) = re.findall(
        rf"^\| CPU time: {name} / ANC–TMM \| implicit, each solver at its best .*\| ([^|]*) \|$",
        readme,
        re.MULTILINE,
    )
    told = [tuple(float(x) for x in part.split("…")) for part in row.split(";")]
    for scene, (least, most) in zip(SCENES, told, strict=True):
        found = [dearer(trade, scene, target, rival) for target in TARGETS]
        assert (f"{min(found):.2g}", f"{max(found):.2g}") == (f"{least:.2g}", f"{most:.2g}")


#: Factor within which the trade and the benchmark agree on a ratio: noise of the machine.
SPREAD = 1.2


@pytest.fixture(scope="module")
def bench():
    """A kept table of the benchmark."""
    return lambda name: pd.read_csv(ROOT / "reports" / "bench" / f"{name}.csv")


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("scene", SCENES)
def test_trade_and_benchmark_agree_on_exudyns_cost_at_equal_error(trade, bench, scene, target):
    rows = bench("equal_error")
    (found,) = rows[(rows["scene"] == scene) & (rows["error"] == target)]["ratio_implicit"]
    assert 1.0 / SPREAD < found / dearer(trade, scene, target, "exudyn-cable") < SPREAD
    assert f"within a factor of {SPREAD:g}" in (ROOT / "reports" / "README.md").read_text(encoding="utf-8")


def test_kept_tables_of_trade_and_benchmark_are_of_one_machine():
    machines = {
        (ROOT / "reports" / name / "machine.json").read_text(encoding="utf-8").split('"versions"')[0]
        for name in ("trade", "bench", "four-bar", "cantilever", "extremes", "fidelity", "published")
    }
    assert len(machines) == 1


def test_the_readme_tells_the_explicit_ratios_of_the_benchmark(bench):
    rows = bench("exudyn")
    found = rows[(rows["scene"] == "cantilever-fall") & (rows["integrator"] == "zhai")]["ratio"]
    told = ", ".join(f"{ratio:.2g}" for ratio in found)
    assert f"cantilevers of 8, 32, 128 cables | {told} |" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_tells_the_cost_of_long_chains_of_the_benchmark(bench):
    rows = bench("length")
    long = rows[(rows["element"] == "shear") & (rows["bodies"] == 1) & (rows["coordinates"] == 2_000_010)]
    by = long.set_index("integrator")["ratio"]
    told = f"explicit and implicit | {by['zhai']:.3g}, {by['generalized-alpha']:.3g} |"
    assert told in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("others", "name"),
    [(("global-dae", "global-dae-dense"), "the global DAE"), (("exudyn-cable",), "Exudyn")],
)
def test_the_readmes_tell_the_largest_differences_of_the_kept_table(others, name):
    pairs = pd.read_csv(ROOT / "reports" / "agreement" / "pairs.csv")
    ours = pairs[(pairs["solver"] == "anctmm") & pairs["other"].isin(others) & pairs["same_element"]]
    largest = ours[ours["status"] == "ok"].groupby("scene")["difference"].max()
    told = [f"{largest[scene]:.1e}".replace("e-0", "e-") for scene in SCENES]
    readme, of_reports = (
        (ROOT / folder / "README.md").read_text(encoding="utf-8") for folder in (".", "reports")
    )
    assert re.search(rf"largest difference from {name}, .*\| {', '.join(told)} \|$", readme, re.MULTILINE)
    assert f"| {name.removeprefix('the ')} | {'; '.join(told)} |" in of_reports


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(
    ("error", "budget"),
    [
        (None, 1e-9), (None, 1e-2),
        *((error, budget) for error in (1e-300, 1e-6, 1e-3, 1e300) for budget in (None, 1e-9, 1e-2)),
    ],
)  # fmt: skip
def test_the_kept_trade_answers_whatever_is_asked(scene, error, budget):
    """Also what no measured setting meets: then the best there is, and why it is not enough."""
    choice = choose(kept().points, scene, error, budget)
    assert choice.line["scene"] == scene
    assert set(choice.runners_up.columns) >= {"kind", "ratio"}
    met = error is None or choice.line["error"] + choice.line["reference_error"] <= error
    assert choice.reached == (met and (budget is None or choice.line["cpu_s"] <= budget))
    assert choice.reached or choice.remarks


def test_of_errors_that_count_as_equal_the_cheapest_is_told():
    """A global DAE was told in place of the same steps at half the cost: their errors differed by rounding."""
    points = kept().points.query("scene == 'four-bar' and solver == 'anctmm' and error > 0")
    first = points.iloc[0]
    twin = first.to_dict() | {"solver": "global-dae", "robust_error": 0.9999 * first["robust_error"]}
    both = pd.DataFrame([twin | {"cpu_s": 2.0 * first["cpu_s"]}, first.to_dict()])
    (line,) = recommended(both, [1e-300]).frame.to_dict("records")
    assert line["status"] == "not reached: no smaller error was measured"
    for told in (line, choose(both, "four-bar", 1e-300, None).line, choose(both, "four-bar", None, 1e3).line):
        assert told["solver"] == first["solver"]
        assert told["cpu_s"] == first["cpu_s"]
