"""Solvers that share an element agree; a solver takes part by the features that it declares."""

import numpy as np
import pytest

from anctmm.errors import UnknownOptionError
from studies.agreement.study import agreement, findings, matrix

SOLVERS = ["anctmm", "global-dae", "exudyn-cable", "opensees"]


def test_solvers_of_one_element_agree_and_others_take_part_where_they_can():
    pairs = agreement(quick=True, solvers=SOLVERS)
    own = pairs[pairs["same_element"]]
    assert set(own["scene"]) == {"four-bar", "cantilever-fall"}
    if (own["status"] == "ok").all():  # Exudyn is installed
        assert len(own) == 6
    assert own["difference"].max() < 1e-6
    frames = pairs[pairs["other"] == "opensees"]
    assert "four-bar" not in set(frames["scene"])  # its clamps turn by no more than half a turn
    square = matrix(pairs, SOLVERS)
    assert np.isnan(np.diag(square)).all()
    assert square.loc["anctmm", "global-dae"] == square.loc["global-dae", "anctmm"] > 0.0
    assert "that share an element agree on both scenes" in findings(pairs)[0]


def test_an_element_can_be_chosen():
    pairs = agreement(True, ["anctmm", "global-dae"], element="quintic", dt=1e-2, mesh=(2,))
    assert set(pairs["element"]) == {"quintic"}
    assert pairs["difference"].max() < 1e-6
    with pytest.raises(UnknownOptionError, match="rope"):
        agreement(True, element="rope")
