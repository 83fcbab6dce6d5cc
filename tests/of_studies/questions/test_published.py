"""Published problems: verdicts, and every digit that is confirmed."""

import numpy as np
import pytest

from studies.published import study
from studies.published.study import PUBLISHED, Found, Published, converged, judged, published

#: Digits of each problem that are confirmed on the quick meshes; a fall is a fault here or there.
CONFIRMED = {
    "elastica, F L²/EI = 3": 7,
    "elastica, 4 cables": 8,
    "roll-up, M L/EI = 2π": 5,
    "shear cantilever, small force": 5,
    "shear cantilever, large force": 6,
    "Lee's frame": 1,
    "catenary, EI → 0": 8,
    "rotating blade": 4,
    "spin-up": 1,
}


def test_confirmed_digits_stay_confirmed():
    frame = published(quick=True)
    for problem, digits in CONFIRMED.items():
        rows = frame[frame["problem"] == problem]
        known = rows[~rows["verdict"].str.startswith("not run")]
        assert (known["digits"] >= digits).all(), known
        assert known["verdict"].str.startswith("confirmed").all(), known
    frames = frame[frame["problem"].str.startswith("L-frame")]["verdict"].tolist()
    if not frames[0].startswith("not run"):  # two versions of one code print two numbers
        assert frames[0].startswith("confirmed as printed")
        assert frames[1].startswith("contradicted")
    assert [s for s in study.findings(frame) if "not comparable" in s][-1].startswith("flying spaghetti")


def test_andrews_squeezer_is_the_published_one():
    rows = [p for p in PUBLISHED if p.problem.startswith("Andrews")]
    assert len(rows) == 7
    assert min(judged(p, p.found(True))[0] for p in rows) >= 6


@pytest.mark.parametrize(
    ("printed", "kind", "found", "digits", "verdict"),
    [
        ("3.5160", "printed", Found(3.51601, 1e-5), 5, "confirmed as printed"),
        ("3.5160", "printed", Found(3.51604, 2e-5), 4, "confirmed to"),
        ("3.5160", "printed", Found(3.5171), 3, "confirmed to 3 digits, not beyond"),
        ("3.5160", "printed", Found(3.7, 0.3), 1, "confirmed to 1 digit"),
        ("3.5160", "printed", Found(3.0, 4.0), 0, "undecided"),
        ("3.5160", "printed", Found(3.9), 1, "contradicted: difference 0.38 Hz, 5e-05 allowed"),
        ("0.5", "exact", Found(0.5, 1e-9), 8, "confirmed to 8 digits"),
        ("0.5", "exact", Found(0.5 + 1e-9, 1e-12), 8, "confirmed to 8 digits, not beyond"),
        ("0.500", "curve", Found(0.504, 1e-5), 2, "confirmed to 2 digits"),
        ("0.500", "curve", Found(0.6, 1e-5), 0, "contradicted"),
    ],
)
def test_verdicts(printed, kind, found, digits, verdict):
    confirmed, said = judged(Published("p", "q", "Hz", printed, "s", kind=kind), found)
    assert (confirmed, said.startswith(verdict)) == (digits, True), said


def test_uncertainties_of_printed_numbers():
    numbers = [Published("p", "q", "m", x, "s").uncertainty for x in ("3.5160", "8.09900305e-4", "-2")]
    assert numbers == pytest.approx([5e-5, 5e-13, 0.5])


def test_limits_of_meshes():
    exact = converged(lambda n: 2.0 + 3.0 / n**4, (4, 8, 16))
    assert exact.found == pytest.approx(2.0, abs=1e-12)
    assert exact.uncertainty == pytest.approx(3.0 / 16**4, rel=1e-9)
    noisy = converged(lambda n: 1.0 + (-1.0) ** np.log2(n) * 1e-9, (4, 8, 16))
    assert abs(noisy.found - 1.0) <= noisy.uncertainty
    assert converged(lambda n: 5.0, (1, 2, 4)).found == 5.0
