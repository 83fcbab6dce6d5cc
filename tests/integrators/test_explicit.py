"""Zhai's integrator: Störmer–Verlet's positions, its stability limit, order, energy, and how a run ends."""

from math import sqrt

import numpy as np
import pytest
from samples import KINDS, bar, frequency_of, row_scene

import anctmm as at
from anctmm.discretise.discretisation import discretise
from anctmm.errors import StabilityError
from anctmm.integrators.stability import largest_step
from anctmm.model.scene import Clamp, Force, Pin
from anctmm.solve import solve
from anctmm.system.system import System

GRAVITY = (0.0, -9.81)
every_kind = pytest.mark.parametrize("kind", KINDS)


def run(scene, dt, steps, stride=1, **options):
    times = {"dt": dt, "t_end": steps * dt, "output_dt": stride * dt}
    return solve(scene, **{"mesh": 2, "integrator": "zhai", **times, **options})


def limit_step(scene, factor, psi=0.5, **options):
    """A part of the largest stable step of small vibrations."""
    return factor * sqrt(2.0 / psi) / frequency_of(scene, **options)


# --- stability ---------------------------------------------------------------------------------------------


def plucked(x=1e-7):
    """A cantilever that a tiny force sets into small vibration."""
    return bar([Clamp("bar.start")], [Force("bar.end", (x, x))])


@every_kind
@pytest.mark.parametrize("psi", [0.5, 1.0])
def test_stable_up_to_the_limit_and_not_beyond(kind, psi):
    """Δt ω_max = 2 for ψ = φ = ½, √2 for 1; half a percent below a vibration stays, half a percent above it grows."""
    options = {"element": kind, "psi": psi, "phi": psi, "check_stability": False}
    below, above = (limit_step(plucked(), f, psi, element=kind) for f in (0.995, 1.005))
    calm = run(plucked(), below, 20_000, **options)
    size = np.abs(calm.displacement("bar.end")).max()
    assert calm.status.ok
    assert 1e-8 < size < 1e-6
    wild = run(plucked(), above, 20_000, 10, **options)
    assert np.abs(wild.displacement("bar.end")).max() > 5.0 * size or not wild.status.ok
    if psi == 0.5:  # otherwise the other modes are damped
        assert wild.status == "diverged"
        assert len(wild.t) < 1000
    run(plucked(), below, 1, **{**options, "check_stability": True})
    with pytest.raises(StabilityError, match=rf"dt is {above!r} s; at most {above / 1.005:.6g} s"):
        run(plucked(), above, 1, **{**options, "check_stability": True})


@pytest.mark.parametrize(("psi", "phi"), [(0.25, 0.5), (0.4, 0.4)])
def test_other_parameters_grow_at_any_step(psi, phi):
    """A fifth of the limit, yet small vibrations grow; with ψ = φ = ½ they do not."""
    h = limit_step(plucked(), 0.2)
    good = run(plucked(), h, 20_000, 20)
    bad = run(plucked(), h, 20_000, 20, psi=psi, phi=phi, check_stability=False)
    assert not bad.status.ok or np.abs(bad.energy.balance).max() > 100.0 * np.abs(good.energy.balance).max()
    with pytest.raises(StabilityError, match=f"psi is {psi} and phi is {phi}"):
        run(plucked(), h, 1, psi=psi, phi=phi)


@every_kind
def test_diverging_run_says_where_and_keeps_its_history(kind):
    """The soft body of the chain is calm; the short one has the high frequency."""
    scene = row_scene("clamp", [("pin", 0.3)], "free", lengths=[1.0, 0.2], turned=(1,), gravity=GRAVITY)
    options = {"mesh": {"b0": 2, "b1": 3}, "element": kind}
    h = limit_step(scene, 1.05, **options)
    motion = run(scene, h, 20_000, 3, check_stability=False, **options)
    status = motion.status
    assert status == "diverged"
    assert status.time == pytest.approx(status.step * h)
    assert (status.body, status.element in range(3)) == ("b1", True)
    for word in (f"step {status.step}", f"element {status.element} of body 'b1'", "smaller dt"):
        assert word in str(status)
    assert motion.t == pytest.approx(np.arange(len(motion.t)) * 3 * h)
    assert motion.t[-1] < status.time <= motion.t[-1] + 3 * h * (1 + 1e-9)
    assert motion.cost.steps == status.step
    for series in (motion.position("b1", 0.0), *vars(motion.energy).values()):
        assert len(series) == len(motion.t)
        assert np.isfinite(series).all()


@pytest.mark.parametrize("step", [0, 4])
def test_what_is_not_finite_ends_a_run_before_it_is_kept(step):
    """A force as large as a history may give, from a step on: the next step's coordinates are useless."""
    h = limit_step(bar([Clamp("bar.start")]), 0.5)
    beyond = Force("bar.end", lambda t: (0.0, 1e100 if t > (step - 0.5) * h else 0.0))
    motion = run(bar([Clamp("bar.start")], [beyond]), h, 10)
    assert (motion.status, motion.status.step) == ("diverged", step + 1)
    assert motion.t == pytest.approx(h * np.arange(step + 1))
    assert len(motion.position("bar", 1.0)) == len(motion.energy.work) == step + 1
    assert "at the output before" not in motion.status.message  # it was not the step's fault


@every_kind
@pytest.mark.parametrize(("psi", "phi"), [(0.5, 0.5), (0.7, 0.6)])
def test_fall_of_a_free_bar_is_exact_for_all_parameters(kind, psi, phi):
    """Of a constant acceleration all members of the family make the exact motion."""
    motion = run(bar(gravity=GRAVITY), 1e-5, 7, element=kind, psi=psi, phi=phi, check_stability=False)
    way = -0.5 * 9.81 * motion.t**2
    assert motion.displacement("bar.end")[:, 1] == pytest.approx(way, rel=1e-6, abs=1e-15)
    assert motion.energy.kinetic == pytest.approx(0.5 * 0.4 * (9.81 * motion.t) ** 2, rel=1e-6, abs=1e-15)


# --- order and energy --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "level"), [("cable", 5e-6), ("shear", 1.5e-7)])
def test_energy_is_bounded_without_drift_over_a_hundred_thousand_steps(kind, level):
    """Half the limit; relative to the largest kinetic energy."""
    scene = bar([Clamp("bar.start")], gravity=(0.0, -0.5))
    motion = run(scene, limit_step(scene, 0.5, element=kind), 100_000, 7, element=kind)
    quarters = motion.energy.balance[1:14281].reshape(4, -1) / motion.energy.kinetic.max()
    size = np.abs(quarters).max(axis=1)
    assert motion.cost.steps == 100_000
    assert size.max() < level
    assert size[3] < 1.1 * size[0]
    assert abs(quarters[3].mean() - quarters[0].mean()) < 0.1 * size[0]


# --- rigid bodies ------------------------------------------------------------------------------------------

LEVER = at.RigidBody("lever", 2.0, 0.3, (0.5, 0.0), points={"o": (0.0, 0.0), "e": (1.0, 0.0)})
TWIST = at.RotationalSpring("lever.o", stiffness=1000.0)
#: Largest stable step of the lever about its hinge: 2 / sqrt(k / (I + m a²)) = 0.05657 s.
LONGEST = 2.0 / sqrt(1000.0 / (0.3 + 2.0 * 0.25))


def lever(joint, *connectors):
    return at.Scene("lever", [LEVER], [joint], gravity=(0.0, -1.0), connectors=connectors)


def test_the_limit_is_that_of_the_spring():
    scene = lever(Pin("lever.o"), TWIST)
    assert at.solve(scene, integrator="zhai", dt=0.999 * LONGEST, t_end=9.99 * LONGEST).status.ok
    with pytest.raises(StabilityError, match=r"at most 0\.05656"):
        at.solve(scene, integrator="zhai", dt=1.001 * LONGEST, t_end=10.01 * LONGEST)


@pytest.mark.parametrize(
    ("joint", "connectors"),
    [
        (Clamp("lever.o"), [TWIST]),
        (Pin("lever.o"), [at.Spring("lever.o", (1.0, 1.0), stiffness=1e6)]),
    ],
    ids=["a twist that is held", "a spring at the hinge"],
)
def test_where_nothing_can_vibrate_steps_may_be_of_any_length(joint, connectors):
    """Springs between places that joints hold had the frequency of rounding: 1e-7 rad/s."""
    system = System(lever(joint, *connectors), discretise(None, {"integrator": "zhai"}))
    assert largest_step(system, system.mesh.reference) > 1e3


def test_a_step_beyond_the_limit_is_told_as_one_and_not_as_a_lock():
    """The lever turns so far in a step that its shape is lost: joints and drives have nothing to do with it."""
    options = {"integrator": "zhai", "dt": 0.2, "t_end": 20.0, "check_stability": False}
    found = at.solve(lever(Pin("lever.o"), TWIST), **options)
    assert (found.status.code, found.status.body) == ("diverged", "lever")
    assert "largest stable step" in found.status.message
    assert "lock" not in found.status.message


def test_a_body_that_turns_too_far_in_a_step_is_told_so():
    """Without a spring there is no limit, and no joint either."""
    spinning = at.RigidBody("top", 1.0, 0.1, (0.0, 0.0), spin=1000.0)
    found = at.solve(at.Scene("top", [spinning]), integrator="zhai", dt=0.02, t_end=1.0)
    assert not found.status.ok
    assert "smaller" in found.status.message
