"""ANC-TMM against its peers: the same element, mesh, integrator and step give the same histories."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from samples import KINDS, SOFT, SQUARE, gap, row_scene

from anctmm import solve, solve_static
from anctmm.discretise.discretisation import Discretisation
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Force, Scene, Torque, Weld
from anctmm.results.metrics import compare
from reference import exudyn_cable, global_dae
from reference.global_dae.layout import Layout
from reference.global_dae.stability import highest
from reference.global_dae.system import System
from studies.scenes import (
    FOUR_BAR_PROBES,
    LENGTH,
    cantilever_fall,
    cantilever_tip_force,
    four_bar,
    four_bar_moment,
)

MESH = {"crank": 2, "coupler": 8, "follower": 2}
QUADRATURES = ("full", "reduced", "lobatto")
#: Exudyn's tightest tolerances that rounding lets it reach: in the four-bar forces are larger.
TIGHT, FOUR_BAR_TIGHT = (1e-9, 1e-11), (1e-9, 1e-9)
every_kind = pytest.mark.parametrize("kind", KINDS)


def implicit(mesh, dt, t_end, **options):
    return Discretisation(mesh=mesh, dt=dt, t_end=t_end, newton_tolerance=1e-14, **options)


def explicit(scene, mesh, kind, t_end, output_dt):
    """A run at a fifth of the stability limit."""
    frequency = highest(System(Layout(scene, Discretisation(mesh=mesh, element=kind))))[0]
    dt = output_dt / int(np.ceil(output_dt * frequency / 0.4))
    return Discretisation(mesh=mesh, element=kind, integrator="zhai", dt=dt, t_end=t_end, output_dt=output_dt)


def difference(one, two, probes=FOUR_BAR_PROBES):
    """Largest over probes and times, relative to the largest displacement."""
    result = compare(one, two, probes)
    assert result.complete, result.statuses
    assert result.common == len(one.t) == len(two.t)
    return result.largest


# --- Exudyn -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("quadrature", QUADRATURES)
def test_falling_cantilever_is_exudyns(quadrature):
    scene = cantilever_fall().scene
    run = implicit(8, 1e-3, 1.0, quadrature=quadrature, output_dt=0.01)
    ours, peer = solve(scene, run), exudyn_cable.solve(scene, run, tolerances=TIGHT)
    assert ours.status.ok
    assert peer.status.ok
    assert max(gap(ours, peer, fraction) for fraction in (0.25, 0.5, 1.0)) < 1e-9 * LENGTH
    assert np.abs(ours.displacement("beam.end")).max() > 0.9 * LENGTH


def test_moment_driven_four_bar_is_exudyns():
    scene, run = four_bar_moment().scene, implicit(MESH, 1e-3, 1.2, output_dt=0.01)
    ours, peer = solve(scene, run), exudyn_cable.solve(scene, run, tolerances=FOUR_BAR_TIGHT)
    assert difference(ours, peer) < 1e-8


@pytest.mark.parametrize("dt", [2e-3, 1e-3])
def test_angle_driven_four_bar_is_exudyns(dt):
    """In both codes the prescribed coordinates enter by their positions, so nothing differs at any step."""
    scene, run = four_bar().scene, implicit(MESH, dt, 0.6, output_dt=0.02)
    ours, peer = solve(scene, run), exudyn_cable.solve(scene, run, tolerances=FOUR_BAR_TIGHT)
    assert difference(ours, peer) < 1e-9


@pytest.mark.parametrize(("load", "quadrature"), list(zip((0.5, 3.0, 10.0), QUADRATURES, strict=True)))
def test_static_cantilever_is_exudyns(load, quadrature):
    scene = cantilever_tip_force(load).scene
    run = Discretisation(mesh=16, quadrature=quadrature, newton_tolerance=1e-12)
    ours, peer = solve_static(scene, run), exudyn_cable.solve_static(scene, run)
    assert ours.status.ok
    assert peer.status.ok
    for fraction in (0.25, 0.5, 1.0):
        apart = ours.position("beam", fraction)[-1] - peer.position("beam", fraction)[-1]
        assert np.abs(apart).max() < 1e-9 * LENGTH


# --- global DAE ---------------------------------------------------------------------------------------------


def both(scene, run, probes):
    """Largest difference of the histories, having checked that something moves."""
    ours, peer = solve(scene, run), global_dae.solve(scene, run)
    assert max(np.abs(ours.displacement(p)).max() for p in probes) > 1e-3
    return difference(ours, peer, probes)


def check_both(scene, mesh, kind, probes, zhai=1e-9, alpha=1e-8):
    """Zhai to 1e-9, generalized-α to 1e-8."""
    assert both(scene, explicit(scene, mesh, kind, 0.02, 0.004), probes) < zhai
    assert both(scene, implicit(mesh, 1e-3, 0.1, element=kind, output_dt=0.01), probes) < alpha


@every_kind
@pytest.mark.parametrize("angle", [0.8, pi])
def test_weld_at_any_angle_is_that_of_the_global_dae(kind, angle):
    scene = row_scene("clamp", [("weld", angle), ("pin", 0.3)], "pin", gravity=(0.0, -9.81))
    check_both(scene, 2, kind, ["b0.end", ("b1", 0.6), ("b2", 0.5)])


@every_kind
def test_driven_hub_at_the_far_end_is_that_of_the_global_dae(kind):
    row = row_scene("free", [("weld", 0.6)], "free", turned=(1,), gravity=(0.0, -9.81))
    scene = replace(row, joints=[*row.joints, Clamp("b1.start", Quintic(0.8, 0.1))])
    check_both(scene, 2, kind, ["b0.start", "b1.end"])


@every_kind
def test_initial_velocities_that_joints_can_have_are_those_of_the_global_dae(kind):
    """At a weld that turns: both bodies turn and stretch alike there."""
    bodies = [
        Beam("a", (0.0, 0.0), (0.5, 0.0), SQUARE, SOFT, lambda s: (0.0, s)),
        Beam("b", (0.5, 0.0), (0.8, 0.4), SQUARE, SOFT, lambda s: (-0.8 * s, 1.0 + 0.6 * s)),
    ]
    scene = Scene("thrown", bodies, [Clamp("a.start"), Weld("a.end", "b.start")])
    check_both(scene, 2, kind, ["a.end", "b.end"])


@every_kind
@pytest.mark.parametrize("rho", [0.0, 0.5, 1.0])
def test_any_spectral_radius_is_that_of_the_global_dae(kind, rho):
    scene = row_scene("clamp", [("pin", 0.5)], "free", gravity=(0.0, -9.81))
    run = implicit(2, 1e-3, 0.2, element=kind, spectral_radius=rho, output_dt=0.01)
    assert both(scene, run, ["b1.end"]) < 1e-8


@pytest.mark.parametrize(("psi", "phi"), [(1.0, 1.0), (0.25, 0.5), (0.0, 0.5)])
def test_any_parameters_of_zhai_are_those_of_the_global_dae(psi, phi):
    scene = row_scene("clamp", [("pin", 0.5)], "free", gravity=(0.0, -9.81))
    run = explicit(scene, 2, "cable", 0.04, 0.004)
    assert both(scene, replace(run, psi=psi, phi=phi, check_stability=False), ["b1.end"]) < 1e-9


@every_kind
@pytest.mark.parametrize("angle", [0.0, 0.8])
def test_statics_are_those_of_the_global_dae(kind, angle):
    """A frame under gravity, a force and a torque, on a clamp and a pin, with a hinge."""
    loads = [Force("b1.end", (0.3, 0.2)), Torque("b0.end", 0.05)]
    links = [("weld", angle), ("pin", 0.5)]
    scene = row_scene("clamp", links, "pin", loads=loads, gravity=(0.0, -1.0))
    run = Discretisation(mesh=4, element=kind, newton_tolerance=1e-12)
    ours, peer = (f(scene, run, load_steps=2) for f in (solve_static, global_dae.solve_static))
    assert ours.status.ok
    assert peer.status.ok
    assert ours.t.tolist() == peer.t.tolist() == [0.0, 0.5, 1.0]
    for body in ("b0", "b1", "b2"):
        assert gap(ours, peer, 0.6, body) < 1e-9
    assert np.abs(ours.displacement("b1.end")[-1]).max() > 5e-5
    assert np.abs(ours.energy.strain - peer.energy.strain).max() < 1e-9 * ours.energy.strain.max()
