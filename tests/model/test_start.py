"""Initial velocities: joints and drives have those of the bodies, or it is told; velocities that fit can be had."""

import pickle
import warnings
from dataclasses import replace
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from samples import INTEGRATORS, SOFT, SQUARE, beam, scene_of

import anctmm as at
from anctmm.errors import JointGapError, PropertyError, StartWarning
from anctmm.model.scene import Beam, Clamp, Pin, Weld
from anctmm.model.velocities import RigidVelocity
from reference import global_dae

#: Rate of the drives here, rad/s.
RATE = 3.0


def turning(t):
    """A drive that turns at once."""
    return RATE * t, RATE, 0.0


def bent_in_motion(scale=1.0):
    """Two bodies in a row whose velocities have a kink where they meet."""
    return [beam(), beam("b", (1.0, 0.0), (2.0, 0.0), velocity=lambda s: (0.0, scale * s))]


# --- what does not fit is refused or told ------------------------------------------------------------------


def test_a_kink_at_a_weld_is_refused():
    """The mean of both sides would have 2.76 of 3.33 J, or another part on another mesh."""
    with pytest.raises(JointGapError, match=r"Weld.*'b\.start' changes at \(0, 1\) 1/s"):
        scene_of(Weld("a.end", "b.start"), bodies=bent_in_motion())
    assert scene_of(Pin("a.end", "b.start"), bodies=bent_in_motion()).joints


@pytest.mark.parametrize("angle", [0.0, 0.7, pi / 2, pi])
@pytest.mark.parametrize("side", [0, 1])
def test_a_motion_that_turns_all_alike_fits_a_weld_at_any_angle(angle, side):
    """Also of a body drawn towards the weld."""
    tip = (1.0 + cos(angle), sin(angle)) if angle != pi else (0.5, 0.0)
    ends = ((1.0, 0.0), tip) if side == 0 else (tip, (1.0, 0.0))
    spin = {n: RigidVelocity(*p, (0.0, 0.0), RATE) for n, p in (("a", ((0.0, 0.0), (1.0, 0.0))), ("b", ends))}
    bodies = [beam(velocity=spin["a"]), beam("b", *ends, velocity=spin["b"])]
    assert scene_of(Weld("a.end", f"b.{('start', 'end')[side]}"), bodies=bodies).joints
    bodies[1] = replace(bodies[1], velocity=RigidVelocity(*ends, (1.0, 0.0), -RATE, (0.0, RATE)))
    with pytest.raises(JointGapError, match="Weld"):
        scene_of(Weld("a.end", f"b.{('start', 'end')[side]}"), bodies=bodies)


@pytest.mark.parametrize("joint", [Pin("a.end"), Clamp("a.end"), Clamp("a.end", turning)])
def test_a_held_end_that_moves_is_refused(joint):
    with pytest.raises(JointGapError, match=r"'a\.end' moves at \(0, 1\) m/s"):
        scene_of(joint, bodies=[beam(velocity=lambda s: (0.0, 1.0))])


@pytest.mark.parametrize(
    ("angle", "velocity", "words"),
    [
        (turning, None, r"'a.start' changes at \(0, 0\) 1/s, clamp 'a.start' angle changes at 3"),
        (turning, lambda s: (0.0, -RATE * s), r"changes at \(0, -3\) 1/s, .* at 3 per second"),
        (None, lambda s: (0.0, s), r"changes at \(0, 1\) 1/s"),
        (None, lambda s: (2.0 * s, 0.0), r"changes at \(2, 0\) 1/s"),
    ],
)
def test_a_clamp_that_turns_otherwise_than_the_body_is_told(angle, velocity, words):
    with pytest.warns(StartWarning, match=words) as said:
        scene_of(Clamp("a.start", angle), bodies=[beam(velocity=velocity)])
    assert "consistent_velocities" in str(said[0].message)
    assert said[0].filename == scene_of.__code__.co_filename


def test_a_clamp_that_turns_as_the_body_is_not_told():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene_of(Clamp("a.start", turning), bodies=[beam(velocity=lambda s: (0.0, RATE * s))])
        scene_of(Clamp("a.start"), bodies=[beam(velocity=lambda s: (0.0, s * s))])


# --- how near is near enough -------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, -0.0, 1e-19, -1e-17])
def test_what_rounding_leaves_of_nothing_is_nothing(noise):
    still = beam("b", (1.0, 0.0), (2.0, 0.0), velocity=lambda s: (0.0, noise))
    for joint in (Pin, Weld):
        assert scene_of(joint("a.end", "b.start"), bodies=[beam(), still]).joints
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert scene_of(Clamp("b.start"), bodies=[beam(), still]).joints


def test_velocities_without_a_slope_are_refused():
    """A jump at a node, and a slope that grows beyond all bounds."""
    for velocity in (lambda s: (0.0, 1.0 if s > 0.0 else 0.0), lambda s: (0.0, sqrt(s))):
        with pytest.raises(PropertyError, match=r"'a' velocity has no slope at fraction 0\.0"):
            scene_of(Clamp("a.start"), bodies=[beam(velocity=velocity)])


# --- velocities that fit -----------------------------------------------------------------------------------


def fitted(scene):
    """The scene with velocities that fit, which nobody warns of."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return at.consistent_velocities(scene)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_driven_bar_that_starts_as_it_must_keeps_its_energy_in_every_road(integrator):
    """To 0.3 %, which bends it a little; from rest the same drive brings up to 3.95 times the energy."""
    rest = scene_of(Clamp("a.start", turning), bodies=[beam()])
    exact = 0.5 * SOFT.density * SQUARE.area / 3.0 * RATE**2
    run = at.Discretisation(
        mesh=4,
        integrator=integrator,
        dt=1e-4 if integrator == "zhai" else 1e-3,
        t_end=3.0,
        output_dt=2e-2,
        newton_tolerance=1e-11,
    )
    for solve in (at.solve, global_dae.solve):
        found = solve(fitted(rest), run)
        assert found.status.ok
        total = found.energy.kinetic + found.energy.strain
        assert total == pytest.approx(np.full(len(total), exact), rel=5e-3)
    total = at.solve(rest, run).energy
    assert (total.kinetic + total.strain).max() == pytest.approx(3.95 * exact, rel=1e-2)


def test_bodies_that_would_bend_at_once_are_told():
    with pytest.raises(JointGapError, match="no velocities of rigid bodies that fit"):
        at.consistent_velocities(scene_of(Clamp("a.start", turning), Pin("a.end"), bodies=[beam()]))


def test_a_rigid_velocity_is_a_value_with_a_text():
    one = RigidVelocity((0.0, 0.0), (3.0, 4.0), (1.0, 0.0), 2.0, (0.5, 0.0))
    assert pickle.loads(pickle.dumps(one)) == one
    assert one(0.5) == pytest.approx((0.5 - 2.0 * 2.0, 2.0 * 0.5))
    body = Beam("b", (0.0, 0.0), (3.0, 4.0), SQUARE, SOFT, one)
    assert body.velocity_slope_at(0.3) == pytest.approx((-2.0 * 4.0, 2.0 * 3.0), rel=1e-9)


# --- many joints, redundant and contradictory ones too -----------------------------------------------------


def parallelogram(cranks, driven=(turning,), coupler_mass=1.0):
    """Equal cranks between the ground and one coupler, of which all but two are redundant; the first are driven."""
    tops = {f"p{i}": (0.1 * i, 1.0) for i in range(cranks)}
    bodies = [at.RigidBody("coupler", coupler_mass, 0.1, (0.0, 1.0), tops)]
    joints = []
    for i in range(cranks):
        points = {"foot": (0.1 * i, 0.0), "top": (0.1 * i, 1.0)}
        bodies.append(at.RigidBody(f"c{i}", 1.0 + i % 3, 0.1, (0.1 * i, 0.5), points))
        joints.append(at.Pin(f"coupler.p{i}", f"c{i}.top"))
        joints.append(at.Clamp(f"c{i}.foot", angle=driven[i]) if i < len(driven) else at.Pin(f"c{i}.foot"))
    return {"name": "parallelogram", "bodies": bodies, "joints": joints}


def test_cranks_that_are_alike_turn_alike():
    """58 of 120 pins say nothing new; the motion is known: all cranks turn as the first, the coupler does not turn."""
    scene = at.consistent_velocities(**parallelogram(60))
    for body in scene.bodies[1:]:
        assert body.spin == pytest.approx(RATE, rel=1e-12)
    coupler = scene.body("coupler")
    assert (*coupler.velocity, coupler.spin) == pytest.approx((-RATE, 0.0, 0.0), abs=1e-12)


def test_what_no_velocities_fit_is_refused():
    """Two cranks that are driven at different rates."""
    faster = (turning, lambda t: (1.3 * RATE * t, 1.3 * RATE, 0.0))
    with pytest.raises(JointGapError, match="no velocities of rigid bodies that fit"):
        at.consistent_velocities(**parallelogram(30, driven=faster, coupler_mass=1e-3))


class Coupling(at.Joint):
    """The second place moves twice as far along y as the first one along x."""

    def equations(self, a, b):
        return [2.0 * a.position @ (1.0, 0.0) - b.position @ (0.0, 1.0) - float(2.0 * a.position.start[0])]


def test_a_joint_of_a_user_s_own_is_kept_at_the_start():
    bodies = [at.PointMass("a", 1.0, (0.5, 0.0)), at.PointMass("b", 1.0, (2.0, 0.0))]
    joints = [Coupling("a.center", "b.center"), at.Slider("a.center", position=turning)]
    with pytest.raises(JointGapError, match="Slider"):
        at.Scene("coupled", bodies, joints)
    made = at.consistent_velocities(name="coupled", bodies=bodies, joints=joints)
    assert made.body("a").velocity == pytest.approx((RATE, 0.0))
    assert made.body("b").velocity == pytest.approx((0.0, 2.0 * RATE))
    moving = [replace(bodies[0], velocity=(3.0, 0.0)), replace(bodies[1], velocity=(0.0, 5.0))]
    with pytest.raises(JointGapError, match=r"Coupling.*\(3, 0\) m/s.*\(0, 5\) m/s.*off by 1"):
        at.Scene("coupled", moving, joints)
