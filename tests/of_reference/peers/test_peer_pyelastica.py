"""PyElastica as a peer: its orders, its limits, and what its law of stretch makes of Reissner's rod."""

import sys

import numpy as np
import pytest
from scipy.integrate import solve_bvp

import anctmm as at
from anctmm.errors import AnctmmError, DiscretisationError, StabilityError
from reference import exudyn_reissner, pyelastica
from reference.exact import solve_static
from studies.engine.runner import Runner
from studies.engine.trials import Trial

L, SECTION, MATERIAL = 2.0, at.Rectangle(0.01, 0.1), at.Material(E=1e7, density=1000.0)
EA, GA = MATERIAL.E * SECTION.area, MATERIAL.lame[1] * SECTION.area
EI = MATERIAL.E * SECTION.second_moment


def beam(turned=False, **more):
    ends = ((L, 0.0), (0.0, 0.0)) if turned else ((0.0, 0.0), (L, 0.0))
    return at.Beam("beam", *ends, SECTION, MATERIAL, **more)


def cantilever(force=(0.0, 0.0), moment=0.0, gravity=0.0, turned=False):
    held, free = ("beam.end", "beam.start") if turned else ("beam.start", "beam.end")
    loads = [at.Force(free, force), at.Torque(free, moment)]
    return at.Scene("cantilever", [beam(turned)], [at.Clamp(held)], loads, (0.0, -gravity))


def fall(**options):
    usual = {"integrator": "zhai", "dt": 1e-4, "t_end": 0.4, "output_dt": 0.02}
    return pyelastica.solve(cantilever(gravity=9.81), **(usual | options))


@pytest.fixture
def elastica():
    return pytest.importorskip("elastica", reason="PyElastica (extra `peers`) is not installed")


def tip_error(exact, **options):
    found = pyelastica.solve_static(cantilever((0.0, -3.0 * EI / L**2)), **options)
    assert found.status.ok
    return np.linalg.norm(found.displacement("beam.end")[-1] - exact) / np.linalg.norm(exact)


# --- statics -------------------------------------------------------------------------------------------------


def test_clamped_rods_are_of_second_order(elastica):
    exact = continuum(3.0 * EI / L**2)
    errors = [tip_error(exact, mesh=n) for n in (4, 8, 16)]
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.08)
    assert 0.001 < errors[2] < 0.002


def continuum(force):
    """Tip's displacement of the rod that PyElastica discretises: Sσ = e n, Bκ = e³ M, with n and M in balance."""

    def slopes(s, state):
        theta, moment = state[:2]
        n, v = -force * np.sin(theta) / EA, -force * np.cos(theta) / GA
        e = (n + np.sqrt(1.0 - v**2)) / (1.0 - n**2 - v**2)  # of e² = (1 + e n)² + (e v)²
        along, across = 1.0 + e * n, e * v
        x = along * np.cos(theta) - across * np.sin(theta)
        y = along * np.sin(theta) + across * np.cos(theta)
        return np.array([moment * e**3 / EI, x * force, x, y])

    def ends(start, end):
        return np.array([start[0], end[1], start[2], start[3]])

    s = np.linspace(0.0, L, 41)
    solved = solve_bvp(slopes, ends, s, np.array([0.0 * s, 0.0 * s, s, 0.0 * s]), tol=1e-9, max_nodes=20000)
    assert solved.success
    return solved.y[2:, -1] - [L, 0.0]


def test_what_is_left_of_the_difference_to_reissner_is_the_law_of_stretch(elastica):
    force = 10.0 * EI / L**2
    scene = cantilever((0.0, -force))
    coarse, fine = (pyelastica.solve_static(scene, mesh=n).displacement("beam.end")[-1] for n in (16, 32))
    limit = fine + (fine - coarse) / 3.0  # second order
    predicted, reissner = continuum(force), solve_static(scene, "reissner").displacement("beam.end")[-1]
    way = np.linalg.norm(reissner)
    difference = np.linalg.norm(predicted - reissner) / way
    assert difference == pytest.approx(7.0e-4, rel=0.01)
    assert np.linalg.norm(limit - predicted) / way < 0.05 * difference


def test_an_end_moment_makes_an_arc_whichever_end_is_held(elastica):
    moment = 1.5 * EI / L
    one = pyelastica.solve_static(cantilever(moment=moment), mesh=16, load_steps=2)
    other = pyelastica.solve_static(cantilever(moment=moment, turned=True), mesh=16)
    assert one.t == pytest.approx([0.0, 0.5, 1.0])
    arc = L * np.array([np.sin(1.5) / 1.5, (1.0 - np.cos(1.5)) / 1.5])
    assert np.linalg.norm(one.position("beam", 1.0)[-1] - arc) < 1.5e-3 * L
    assert one.position("beam", 1.0)[-1] == pytest.approx(other.position("beam", 0.0)[-1], abs=1e-6)


# --- motion --------------------------------------------------------------------------------------------------


def test_a_fall_tends_to_reissners_by_second_order(elastica):
    fine = exudyn_reissner.solve(cantilever(gravity=9.81), mesh=32, dt=5e-4, t_end=0.4, output_dt=0.02)
    found = [fall(mesh=n) for n in (8, 16)]
    errors = [at.compare(f, fine, ["beam.end", ("beam", 0.5)]).error for f in found]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.25)
    assert errors[1] < 5e-3
    assert [f.dofs for f in found] == [51, 99]
    assert found[0].cost.steps == 4000


def test_the_stable_step_is_that_of_the_grid(elastica):
    from reference.pyelastica.model import Rod

    limit = 2.0 / Rod(cantilever(), beam(), 8).largest_frequency
    long = {"mesh": 8, "t_end": 2000 * limit, "check_stability": False}
    assert fall(**long | {"dt": limit * 2000 / 2021, "output_dt": None}).status.ok
    above = fall(**long | {"dt": limit * 2000 / 1961, "output_dt": None})
    assert above.status.code in ("diverged", "inaccurate")
    assert np.isfinite(above.position("beam", 1.0)).all()
    with pytest.raises(
        StabilityError, match=r"dt \(s\) is 0.01; at most 0.0\d+ is stable for PyElastica's rods"
    ):
        fall(mesh=8, dt=1e-2)


def test_a_given_velocity_turns_a_free_bar(elastica):
    spun = at.Scene("spun", [beam(velocity=lambda x: (0.0, 2.0 * L * (x - 0.5)))])
    found = pyelastica.solve(spun, mesh=8, integrator="zhai", dt=1e-4, t_end=0.5, output_dt=0.5)
    along = found.position("beam", 1.0)[-1] - found.position("beam", 0.0)[-1]
    assert np.arctan2(along[1], along[0]) == pytest.approx(1.0, abs=0.01)


# --- limits --------------------------------------------------------------------------------------------------

FREE = at.Scene("free", [beam()])
TWO = [beam(), at.Beam("other", (L, 0.0), (2 * L, 0.0), SECTION, MATERIAL)]


@pytest.mark.parametrize(
    ("scene", "options", "reason"),
    [
        (at.Scene("s", TWO, [at.Pin("beam.end", "other.start")]), {}, "joins ends of bodies; PyElastica's joints are"),
        (at.Scene("s", [beam()], [at.Clamp("beam.start", at.Quintic(1.0, 1.0))]), {}, "a fixed clamp"),
        (at.Scene("s", [beam()], [], [at.Torque("beam.end", np.sin)]), {}, "a constant load"),
        (FREE, {"mesh": 1}, "body 'beam' has 1 element; PyElastica needs 2 or more"),
        (FREE, {"integrator": "generalized-alpha"}, "has zhai alone"),
        (FREE, {"psi": 0.6, "phi": 0.6}, "psi, phi are 0.6, 0.6; PyElastica has only the Verlet scheme"),
    ],
)  # fmt: skip
def test_what_it_cannot_do_is_unsupported(scene, options, reason):
    usual = {"mesh": 4, "integrator": "zhai", "dt": 1e-4, "t_end": 1e-3}
    found = pyelastica.solve(scene, **(usual | options))
    assert found.status.code == "unsupported"
    assert reason in found.status.message
    assert len(found.t) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"shear_factor": 0.0}, "shear_factor is 0.0; a number greater than 0"),
        ({"load_steps": 0}, "load_steps is 0; a whole number from 1 on"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(AnctmmError, match=message) as told:
        pyelastica.solve_static(cantilever(), mesh=4, **options)
    assert isinstance(told.value, DiscretisationError)


def test_without_pyelastica_its_rows_say_so_and_the_rest_runs(monkeypatch):
    monkeypatch.setitem(sys.modules, "elastica", None)
    monkeypatch.delitem(sys.modules, "reference.pyelastica.model", raising=False)
    static = {"mesh": (4,), "element": "shear", "integrator": "static"}
    cases = [Trial(cantilever((0.0, -1.0)), name, **static) for name in ("pyelastica", "anctmm")]
    peer, ours = Runner().solve_many(cases)
    assert str(peer.status).startswith(
        "unsupported: pyelastica is not installed; pip install 'anctmm[peers]'"
    )
    assert ours.status.ok
