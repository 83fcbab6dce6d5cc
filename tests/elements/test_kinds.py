"""Kinds of element are data: what is said of each holds, and one more entry is one more kind everywhere."""

from dataclasses import replace
from itertools import combinations, product

import pytest
from samples import SOFT, SQUARE

import anctmm as at
import reference.exudyn.cable
import reference.exudyn.reissner
import reference.global_dae
import reference.opensees
import reference.pyelastica
from anctmm.discretise.discretisation import INTEGRATORS, Discretisation
from anctmm.elements import kinds
from anctmm.elements.cable import CableElement
from anctmm.elements.kinds import (
    KINDS,
)
from anctmm.errors import DiscretisationError, MeshError, UnknownOptionError

SECTION = at.Rectangle(0.05, 0.05)
BODY = at.Beam("b", (0.0, 0.0), (3.0, 4.0), SQUARE, SOFT)


def test_kinds_weld_of_which_joints_hold_the_same_vectors():
    welds = {(a, b) for a, b in product(KINDS, KINDS) if KINDS[a].welds_to(KINDS[b])}
    assert welds == {("shear", "shear"), *product(("cable", "quintic", "rigid"), repeat=2)}


@pytest.mark.parametrize("name", ["rod", None])
def test_unknown_kinds_are_refused_by_name(name):
    with pytest.raises(UnknownOptionError, match="allowed are 'cable', 'quintic', 'rigid', 'shear'"):
        Discretisation(1, element=name)


# --- one more kind -----------------------------------------------------------------------------------------


class DoubleElement(CableElement):
    """A cable of twice the bending stiffness."""

    @classmethod
    def of(cls, body, elements, quadrature="full"):
        one = CableElement.of(body, elements, quadrature)
        return cls(one.l, one.EA, 2.0 * one.EI, one.mass_per_length, quadrature, one.damping)


@pytest.fixture
def double(monkeypatch):
    """A kind that is added by an entry and a class."""
    kind = replace(KINDS["cable"], name="double", title="double cables", element=DoubleElement)
    monkeypatch.setitem(kinds.KINDS, "double", kind)
    return kind


def hinged(section=SECTION, **changes):
    """A clamped and a pinned beam under a torque."""
    bodies = [
        at.Beam("a", (0.0, 0.0), (0.5, 0.0), section, SOFT),
        at.Beam("c", (0.5, 0.0), (1.0, 0.0), section, SOFT),
    ]
    joints = [at.Clamp("a.start"), at.Pin("a.end", "c.start")]
    scene = at.Scene("hinged", bodies, joints, loads=[at.Torque("c.end", 0.02)], gravity=(0.0, -9.81))
    return replace(scene, **changes)


def test_a_kind_that_others_do_not_know_is_unsupported_there(double):
    for solve, integrator in (
        (reference.exudyn.cable.solve, "generalized-alpha"),
        (reference.pyelastica.solve, "zhai"),
    ):
        found = solve(hinged(joints=[at.Clamp("a.start")], bodies=hinged().bodies[:1], loads=[]), mesh=2,
                      element="double", integrator=integrator, dt=1e-5, t_end=2e-5)  # fmt: skip
        assert found.status.code == "unsupported"
        assert "'double' for body 'a'" in found.status.message


def test_a_kind_without_an_integrator_or_statics_is_refused_there(double, monkeypatch):
    for able in combinations(INTEGRATORS, 1):
        monkeypatch.setitem(kinds.KINDS, "double", replace(double, integrators=able, statics=False))
        for other in set(INTEGRATORS) - set(able):
            with pytest.raises(
                DiscretisationError,
                match=f"integrator '{other}' needs .* has double cables with '{able[0]}'",
            ):
                at.solve(hinged(), mesh=2, element="double", integrator=other, dt=1e-5, t_end=2e-5)
        with pytest.raises(DiscretisationError, match="element is 'double' for body 'a'; statics needs"):
            at.solve_static(hinged(), mesh=2, element="double")


def test_a_rigid_body_is_one_element():
    with pytest.raises(MeshError, match="mesh is 2 for rigid body 'b'; 1 is needed"):
        Discretisation(2, element="rigid").of(at.Scene("s", [BODY]))
