"""Motion of quintic cables beside the global DAE: every joint, load and mixture of kinds, explicit and implicit.

Interpreted, for what `test_random_scenes` says.
"""

import json

import quintic_against_dae
from uncompiled import said_by

#: Largest difference of a coordinate, m or 1, that rounding and Newton's tolerance may make.
ALLOWED = {"zhai": 1e-13, "generalized-alpha": 1e-9}


def test_motions_are_those_of_the_global_dae():
    found = json.loads(said_by("processes/quintic_against_dae.py"))
    assert len(found) == 2 * len(quintic_against_dae.SCENES)
    for name, (ends, apart) in found.items():
        assert ends == "ok ok", name
        assert apart < ALLOWED[name.rpartition(": ")[2]], (name, apart)
