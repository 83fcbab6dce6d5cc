"""Motion of quintic cables beside the global DAE: every joint, load and mixture of kinds, explicit and implicit."""

import pytest
from quintic_against_dae import SCENES, apart

#: Largest difference of a coordinate, m or 1, that rounding and Newton's tolerance may make.
ALLOWED = {"zhai": 1e-13, "generalized-alpha": 1e-9}


@pytest.mark.parametrize("integrator", ALLOWED)
@pytest.mark.parametrize("name", SCENES)
def test_motions_are_those_of_the_global_dae(name, integrator):
    ends, difference = apart(name, integrator)
    assert ends == "ok ok"
    assert difference < ALLOWED[integrator]
