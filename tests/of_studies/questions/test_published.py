"""Published problems: verdicts, and every digit that is confirmed."""

import numpy as np
import pandas as pd
import pytest

from reference.exact.andrews import PUBLISHED
from studies.published import motions, study
from studies.published.problem import Published, Value, agreeing, converged, last_digit

#: Digits of each published number that are confirmed on the quick meshes; a fall is a fault here or there.
CONFIRMED = {
    ("elastica, F L²/EI = 3", "tip displacement x"): 7,
    ("elastica, F L²/EI = 3", "tip displacement y"): 9,
    ("elastica, 4 cables", "tip displacement x"): 8,
    ("elastica, 4 cables", "tip displacement y"): 8,
    ("roll-up, M L/EI = 2π", "tip displacement x"): 5,
    ("shear cantilever, small force", "tip displacement y, size"): 5,
    ("shear cantilever, large force", "tip displacement x, size"): 6,
    ("shear cantilever, large force", "tip displacement y, size"): 6,
    ("Lee's frame", "first limit load"): 2,
    ("Lee's frame", "second limit load"): 1,
    ("catenary, EI → 0", "lowest point y"): 7,
    ("rotating blade", "flap frequency at speed 0"): 5,
    ("rotating blade", "flap frequency at speed 1"): 4,
    ("rotating blade", "flap frequency at speed 2"): 5,
    ("rotating blade", "flap frequency at speed 5"): 5,
    ("rotating blade", "flap frequency at speed 10"): 5,
    ("spin-up", "mean stretch of the steady turn"): 1,
    **{("Andrews' squeezer", f"{name} at 0.03 s"): 6 for name in PUBLISHED},
}


@pytest.fixture(scope="module")
def found():
    """Those of a quick run, and on coarse meshes what it leaves out."""
    return [*study.problems(quick=True), *motions.squeezer(quick=True)]


@pytest.mark.exhaustive
def test_confirmed_digits_stay_confirmed(found):
    digits = {(p.problem, p.quantity): p.digits for p in found if p.found}
    assert {key: digits[key] for key in CONFIRMED if digits[key] < CONFIRMED[key]} == {}
    for p in found:
        if (p.problem, p.quantity) in CONFIRMED:
            assert p.verdict.startswith("confirmed"), (p.problem, p.verdict)


@pytest.mark.exhaustive
def test_two_versions_of_one_code_print_two_numbers(found):
    """The one quoted is that of linear elements, to its last digit; the one of another version is not."""
    quoted, stored = (p for p in found if p.problem.startswith("L-frame"))
    assert (quoted.digits, quoted.verdict) == (15, "confirmed to 15 digits")
    assert stored.verdict.startswith("contradicted: 1.3 m apart")


@pytest.mark.exhaustive
def test_the_table_and_its_sentences(found):
    frame = pd.DataFrame([line for p in found for line in study.lines(p)], columns=list(study.COLUMNS))
    assert len(frame) >= 19
    assert frame["verdict"].notna().sum() == len(found)
    said = study.findings(tuple(found))
    assert "cannot be compared" in said[0]
    assert [s for s in said if "not comparable" in s] == [s for s in said if s.startswith("flying spaghetti")]


@pytest.mark.parametrize(
    ("value", "found", "verdict"),
    [
        (3.516, Value(3.51601), "confirmed to 5 digits"),
        (3.516, Value(3.5164, 1e-3), "confirmed to 3 digits"),
        (3.516, Value(3.5171), "confirmed to 3 of 5 digits, not beyond"),
        (3.516, Value(3.9), "contradicted: 0.38 Hz apart, 5e-05 allowed"),
        (3.516, None, "not comparable: a wing"),
        (0.5, Value(0.5), "confirmed to 15 digits"),
    ],
)
def test_verdicts(value, found, verdict):
    values = {} if found is None else {"cable": found, "other": Value(7.0)}
    said = Published("p", "q", "Hz", value, 5e-5, "s", values, needs="a wing")
    assert said.verdict == verdict


def test_digits():
    assert [agreeing(1.0, 1.0), agreeing(1.0, 1.0004), agreeing(1.0, -1.0), agreeing(0.0, 0.0)] == [
        15,
        3,
        0,
        15,
    ]
    assert [last_digit(x) for x in ("3.5160", "8.09900305e-4", "-2", "18.7e3")] == pytest.approx(
        [5e-5, 5e-13, 0.5, 50.0]
    )


def test_limits_of_meshes():
    exact = converged(lambda n: 2.0 + 3.0 / n**4, (4, 8, 16))
    assert exact.value == pytest.approx(2.0, abs=1e-12)
    assert exact.uncertainty == pytest.approx(3.0 / 16**4, rel=1e-9)
    noisy = converged(lambda n: 1.0 + (-1.0) ** np.log2(n) * 1e-9, (4, 8, 16))
    assert abs(noisy.value - 1.0) <= noisy.uncertainty
    assert converged(lambda n: 5.0, (1, 2, 4)).value == 5.0
