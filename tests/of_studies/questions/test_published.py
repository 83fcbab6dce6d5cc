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
    ("elastica, 4 cables", "tip displacement y"): 9,
    ("roll-up, M L/EI = 2π", "tip displacement x"): 5,
    ("shear cantilever, small force", "tip displacement y, size"): 5,
    ("shear cantilever, large force", "tip displacement x, size"): 6,
    ("shear cantilever, large force", "tip displacement y, size"): 6,
    ("Lee's frame", "first limit load"): 2,
    ("Lee's frame", "second limit load"): 1,
    ("catenary, EI → 0", "lowest point y"): 8,
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
    assert (quoted.digits, quoted.verdict) == (13, "confirmed as printed (13 digits)")
    assert stored.verdict.startswith("contradicted: 1.3 m apart")


@pytest.mark.exhaustive
def test_the_table_and_its_sentences(found):
    frame = pd.DataFrame([line for p in found for line in study.lines(p)], columns=list(study.COLUMNS))
    assert len(frame) >= 19
    assert frame["verdict"].notna().sum() == len(found)
    said = study.findings(tuple(found))
    assert said[0].startswith(
        f"Of {len(found) - 1} published numbers {sum(p.as_printed for p in found)} are confirmed as"
    )
    assert said[0].endswith("1 contradicted; 1 cannot be compared.")
    assert [s for s in said if "not comparable" in s] == [s for s in said if s.startswith("flying spaghetti")]


@pytest.mark.exhaustive
def test_no_more_digits_than_the_uncertainty_of_what_is_found_leaves(found):
    for p in found:
        if p.decisive is not None and p.decisive.uncertainty > 0.0:
            left = -np.log10(p.decisive.uncertainty / abs(p.decisive.value))
            assert p.digits <= left, (p.problem, p.quantity)


@pytest.mark.parametrize(
    ("found", "digits", "verdict"),
    [
        (Value(3.51601), 5, "confirmed as printed (5 digits)"),
        (Value(3.51601, 1e-5), 5, "confirmed as printed (5 digits)"),
        (Value(3.51604, 2e-5), 4, "confirmed to 4 of 5 digits"),  # may be 3.5161 when rounded
        (Value(3.516, 4e-5), 4, "confirmed to 4 of 5 digits"),  # agrees better than its uncertainty says
        (Value(3.5164, 1e-3), 3, "confirmed to 3 of 5 digits"),
        (Value(3.5171), 3, "confirmed to 3 of 5 digits, not beyond"),
        (Value(3.51606), 4, "confirmed to 4 of 5 digits, not beyond"),
        (Value(3.7, 0.3), 1, "confirmed to 1 of 5 digits"),
        (Value(3.0, 2.0), 0, "undecided: what is found here is uncertain by 2 Hz"),
        (Value(3.9), 1, "contradicted: 0.38 Hz apart, 5e-05 allowed"),
        (None, 0, "not comparable: a wing"),
    ],
)
def test_verdicts(found, digits, verdict):
    values = {} if found is None else {"cable": found, "other": Value(7.0)}
    said = Published("p", "q", "Hz", 3.516, 5e-5, "s", values, needs="a wing")
    assert (said.digits, said.verdict) == (digits, verdict)


@pytest.mark.parametrize(
    ("kind", "found", "verdict"),
    [
        ("exact", Value(0.5), "confirmed to 15 digits"),
        ("exact", Value(0.5, 1e-9), "confirmed to 8 digits"),
        ("exact", Value(0.5 + 1e-9, 1e-12), "confirmed to 8 digits, not beyond"),
        ("curve", Value(0.504, 1e-5), "confirmed to 2 digits, within the 2% of the curve"),
        ("curve", Value(0.6, 1e-5), "contradicted: 0.1 m apart, 0.01 allowed"),
    ],
)
def test_verdicts_of_what_was_not_printed(kind, found, verdict):
    allowed = {"exact": 1e-15, "curve": 0.02 * 0.5}[kind]
    assert Published("p", "q", "m", 0.5, allowed, "s", {"cable": found}, kind=kind).verdict == verdict


def test_a_worse_value_is_not_confirmed_to_more_digits():
    digits = [
        Published("p", "q", "m", 15.8107712, 5e-8, "s", {"rigid": Value(15.8107712, 10.0**-k)}).digits
        for k in range(9)
    ]
    assert digits == sorted(digits)
    assert (digits[0], digits[5]) == (1, 6)


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
