"""Cases: what they hold, and what they refuse."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import CaseError, PropertyError, UnknownKindError, UnknownNameError

BEAM = at.Beam("arm", (0, 0), (1, 0), at.Circle(0.01), at.Material(E=1e9, density=1000.0))
SCENE = at.Scene("s", [BEAM], [at.Clamp("arm.start")])


def test_a_case_holds_plain_values():
    case = at.Case(SCENE, ["arm.end", ["arm", np.float64(0.5)]], t_end=np.float64(2.0), output_dt=1, note="n")
    assert case.probes == ("arm.end", ("arm", 0.5))
    assert (case.name, case.duration, case.interval, case.static) == ("s", 2.0, 1.0, False)
    assert type(case.t_end) is type(case.output_dt) is type(case.probes[1][1]) is float
    assert case == at.Case(SCENE, ("arm.end", ("arm", 0.5)), 2.0, 1.0, "n")


def test_a_hundred_outputs_are_compared_where_nothing_is_said():
    assert at.Case(SCENE, ["arm.end"], t_end=0.7).interval == pytest.approx(0.007, rel=1e-15)


def test_a_case_without_an_end_is_static():
    case = at.Case(SCENE, ["arm.end"], t_end=None)
    assert (case.static, case.duration, case.interval) == (True, 0.0, 0.0)


class Sub(at.Scene):
    pass


@pytest.mark.parametrize(
    ("changes", "error", "said"),
    [
        ({"scene": "s"}, UnknownKindError, "scene is 's' of type str"),
        ({"scene": None}, UnknownKindError, "a Scene is needed"),
        ({"scene": Sub("s", [BEAM])}, UnknownKindError, "type Sub"),
        ({"probes": []}, CaseError, r"has probes \[\]; a list of at least one"),
        ({"probes": "arm.end"}, CaseError, "has probes 'arm.end'; a list"),
        ({"probes": {"arm.end"}}, CaseError, "a list of at least one"),
        ({"probes": ("arm.end" for _ in iter(int, 1))}, CaseError, "at most"),
        ({"probes": ["leg.end"]}, UnknownNameError, "'leg'"),
        ({"probes": ["arm.middle"]}, UnknownNameError, "middle"),
        ({"probes": [("arm", 1.5)]}, PropertyError, "1.5"),
        ({"probes": [("arm", float("nan"))]}, PropertyError, "nan"),
        ({"probes": ["arm.end", ("arm", 1.0)]}, CaseError, r"\('arm', 1.0\) twice"),
        ({"t_end": 0.0}, CaseError, r"t_end \(s\), is 0.0; a number greater than 0"),
        ({"t_end": float("inf")}, CaseError, "inf"),
        ({"t_end": "1"}, CaseError, "'1'"),
        ({"t_end": None}, CaseError, "output_dt 0.1 without t_end"),
        ({"output_dt": 0.0}, CaseError, r"output_dt \(s\), is 0.0"),
        ({"output_dt": 0.3}, CaseError, "no whole number of output_dt 0.3 s; such as 0.33333"),
        ({"output_dt": 3.0}, CaseError, "such as 1.0 is needed"),
        ({"note": 3}, CaseError, "has note 3; a text"),
    ],
)
def test_what_is_wrong_is_named(changes, error, said):
    with pytest.raises(error, match=said):
        at.Case(**({"scene": SCENE, "probes": ["arm.end"], "t_end": 1.0, "output_dt": 0.1} | changes))
