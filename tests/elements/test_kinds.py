"""Kinds of element are data: what is said of each holds, and what a kind cannot do is refused."""

from dataclasses import replace
from itertools import product

import pytest
from samples import SOFT, SQUARE

import anctmm as at
from anctmm.discretise.discretisation import INTEGRATORS, Discretisation
from anctmm.elements import kinds
from anctmm.elements.kinds import KINDS
from anctmm.errors import DiscretisationError, MeshError, UnknownOptionError
from reference import exudyn_cable, pyelastica

BODY = at.Beam("b", (0.0, 0.0), (3.0, 4.0), SQUARE, SOFT)
SCENE = at.Scene("clamped", [BODY], [at.Clamp("b.start")])


def test_kinds_weld_of_which_joints_hold_the_same_vectors():
    welds = {(a, b) for a, b in product(KINDS, KINDS) if KINDS[a].welds_to(KINDS[b])}
    assert welds == {("shear", "shear"), *product(("cable", "quintic", "rigid"), repeat=2)}


@pytest.mark.parametrize("name", ["rod", None])
def test_unknown_kinds_are_refused_by_name(name):
    with pytest.raises(UnknownOptionError, match="allowed are 'cable', 'quintic', 'rigid', 'shear'"):
        Discretisation(1, element=name)


@pytest.mark.parametrize(
    ("solve", "integrator"), [(exudyn_cable.solve, "generalized-alpha"), (pyelastica.solve, "zhai")]
)
def test_a_kind_that_another_code_does_not_know_is_unsupported_there(solve, integrator):
    found = solve(SCENE, mesh=2, element="quintic", integrator=integrator, dt=1e-5, t_end=2e-5)
    assert found.status.code == "unsupported"
    assert "'quintic' for body 'b'" in found.status.message


@pytest.mark.parametrize("able", INTEGRATORS)
def test_a_kind_without_an_integrator_or_statics_is_refused_there(able, monkeypatch):
    kind = replace(KINDS["cable"], name="double", title="double cables", integrators=(able,), statics=False)
    monkeypatch.setitem(kinds.KINDS, "double", kind)
    for other in set(INTEGRATORS) - {able}:
        with pytest.raises(DiscretisationError, match=f"'{other}' needs .* has double cables with '{able}'"):
            at.solve(SCENE, mesh=2, element="double", integrator=other, dt=1e-5, t_end=2e-5)
    with pytest.raises(DiscretisationError, match="element is 'double' for body 'b'; statics needs"):
        at.solve_static(SCENE, mesh=2, element="double")


def test_a_rigid_body_is_one_element():
    with pytest.raises(MeshError, match="mesh is 2 for rigid body 'b'; 1 is needed"):
        Discretisation(2, element="rigid").of(at.Scene("s", [BODY]))
