"""The method of fourth order: its coefficients, order and level of error, stages, energy, and what it refuses."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from samples import SOFT, SQUARE, acted_on, bar, linkage
from scipy.integrate import solve_ivp

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.methods import stages
from anctmm.model.drives import Quintic
from reference.global_dae.layout import Layout
from reference.global_dae.saddle import Nearest, Saddle
from reference.global_dae.system import System

GRAVITY = (0.0, -9.81)


def beam(name, start, end):
    return at.Beam(name, start, end, SQUARE, SOFT)


def falling():
    return bar([at.Clamp("bar.start")], gravity=GRAVITY)


def triangle():
    """A welded triangle that swings: a loop that does not pass through the ground."""
    a, b, c = (0.0, 0.0), (0.4, 0.0), (0.1, -0.3)
    bodies = [beam("one", a, b), beam("two", b, c), beam("three", c, a)]
    joints = [at.Pin("one.start", "three.end", grounded=True), at.Weld("one.end", "two.start")]
    joints.append(at.Weld("two.end", "three.start"))
    return at.Scene("triangle", bodies, joints, gravity=GRAVITY)


def freed():
    """The linkage whose driven clamp leaves the stretch free."""
    scene = linkage(0.4)
    return replace(scene, joints=(replace(scene.joints[0], stretch="free"), *scene.joints[1:]))


def fan():
    """Two beams, welded to each other, turned by a clamp that leaves the stretch free; a third on a fixed one."""
    bodies = [
        beam("one", (0, 0), (0.4, 0.3)),
        beam("two", (0, 0), (-0.3, 0.2)),
        beam("three", (1, 0), (1, 0.4)),
    ]
    joints = [
        at.Clamp("one.start", angle=Quintic(1.0, 0.2), stretch="free"),
        at.Weld("one.start", "two.start"),
        at.Clamp("three.start", stretch="free"),
    ]
    return at.Scene("fan", bodies, joints, gravity=GRAVITY)


#: By name: the scene, elements of each beam, and their kind.
SCENES = {
    "falling": (falling, 2, "cable"),
    "linkage": (partial(linkage, 0.4), 1, "cable"),
    "triangle": (triangle, 1, "cable"),
    "freed": (freed, 1, "cable"),
    "falling, shear": (falling, 2, "shear"),
    "linkage, shear": (partial(linkage, 0.4), 1, "shear"),
    "fan, shear": (fan, 1, "shear"),
    "linkage, quintic": (partial(linkage, 0.4), 1, "quintic"),
    "fan, quintic": (fan, 1, "quintic"),
}


def of_quintics(name):
    """Whether a scene is of quintic cables, whose kernels take Python long."""
    return "quintic" in name


def coordinates(found):
    """All coordinates of a solution, (outputs, dofs)."""
    fields = [found.fields[body.name] for body in found.scene.bodies]
    return np.concatenate([f.coordinates.reshape(len(found.t), -1) for f in fields], axis=1)


class Dense:
    """The same equations of a scene for SciPy, all matrices dense."""

    def __init__(self, scene, run):
        self.system = System(Layout(scene, run))
        layout, c = self.system.layout, self.system.constraints
        self.q, p = layout.reference.copy(), c.parameters(0.0)
        J = c.jacobian(self.q, p)
        self.v = layout.velocity - Nearest(J)(J @ layout.velocity + c.rate(self.q, p))

    def force(self, t, q, v):
        return self.system.force(q, v, t) + self.system.beams.damping(q, v)

    def accelerations(self, t, q, v):
        c = self.system.constraints
        p = c.parameters(t)
        return Saddle(self.system.mass, c.jacobian(q, p)).solve(self.force(t, q, v), c.right(q, v, p))[0]

    def by_scipy(self, times):
        """DOP853, explicit and of order 8."""
        n = len(self.q)
        found = solve_ivp(
            lambda t, x: np.concatenate([x[n:], self.accelerations(t, x[:n], x[n:])]),
            (0.0, times[-1]), np.concatenate([self.q, self.v]), "DOP853", times, rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        assert found.success
        return found.y[:n].T


# --- coefficients ------------------------------------------------------------------------------------------


def test_conditions_of_order_four():
    """All eight of them, and stages of second order (Hairer, Nørsett & Wanner, II.2)."""
    A, square, c = stages()
    b, ones = A[-1], np.ones(len(c))
    for weights, value in [
        (ones, 1), (c, 1 / 2), (c**2, 1 / 3), (A @ c, 1 / 6), (c**3, 1 / 4), (c * (A @ c), 1 / 8), (A @ c**2, 1 / 12),
        (A @ A @ c, 1 / 24),
    ]:  # fmt: skip
        assert b @ weights == pytest.approx(value, abs=1e-15)
    assert np.abs(A @ ones - c).max() < 1e-15
    assert np.abs(A @ c - c**2 / 2).max() < 1e-15
    assert np.abs(square - A @ A).max() == 0.0
    assert set(np.diag(A)) == {0.0, 0.25}


# --- motion ------------------------------------------------------------------------------------------------


#: Largest error of any coordinate in 0.03 s by steps of 0.5 ms, or of 0.25 ms where those do not resolve what vibrates;
#: the thickness of shear elements is too stiff for an explicit method of SciPy to be more exact.
LEVELS = {
    "falling": 1e-6, "linkage": 2e-6, "triangle": 1e-6, "freed": 5e-6, "linkage, quintic": 3e-5, "fan, quintic": 5e-5,
}  # fmt: skip


@pytest.mark.parametrize("name", LEVELS)
def test_fourth_order_against_scipy(name):
    """Half a step leaves a sixteenth of the error; its level is asserted, too."""
    make, mesh, element = SCENES[name]
    scene, errors, exact = make(), [], None
    for dt in (2.5e-4, 1.25e-4) if element == "quintic" else (5e-4, 2.5e-4):
        run = Discretisation(
            mesh,
            element=element,
            integrator="esdirk",
            dt=dt,
            t_end=0.03,
            output_dt=0.01,
            newton_tolerance=1e-13,
        )
        found = at.solve(scene, run)
        exact = Dense(scene, run).by_scipy(found.t) if exact is None else exact
        errors.append(float(np.abs(coordinates(found) - exact).max()))
    assert errors[0] < LEVELS[name], errors
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


def test_dampers_springs_and_followers_keep_the_order_and_the_balance_of_energy():
    scene, found = acted_on(), []
    for dt in (4e-3, 2e-3, 1e-3):
        run = Discretisation(
            2, integrator="esdirk", dt=dt, t_end=0.04, output_dt=0.02, newton_tolerance=1e-13
        )
        found.append(at.solve(scene, run))
    differences = [np.abs(coordinates(a) - coordinates(b)).max() for a, b in pairwise(found)]
    assert differences[0] < 1e-4
    assert np.log2(differences[0] / differences[1]) == pytest.approx(4.0, abs=0.7)
    balance = [np.abs(x.energy.balance).max() for x in found]
    assert balance[2] < 1e-6 * np.abs(found[2].energy.work).max()
    assert balance[2] < balance[1] / 8.0
    usual = at.solve(scene, Discretisation(2, dt=2e-4, t_end=0.04, output_dt=0.02, spectral_radius=1.0))
    assert np.abs(coordinates(usual) - coordinates(found[2])).max() < 1e-4


def test_energy_of_a_long_swing_stays():
    """400 steps, some eight periods: what the method takes is of sixth order in the step."""
    scene = bar([at.Pin("bar.start")], gravity=GRAVITY)
    lost = []
    for dt in (2e-2, 1e-2):
        run = Discretisation(1, integrator="esdirk", dt=dt, t_end=2.0, output_dt=0.1)
        found = at.solve(scene, run)
        assert found.status.ok
        lost.append(np.abs(found.energy.balance).max() / found.energy.kinetic.max())
    assert lost[1] < 1e-3
    assert lost[1] < lost[0] / 4.0


# --- what is refused, and how runs end ---------------------------------------------------------------------


def test_a_point_mass_a_slider_and_an_object_as_integrator():
    """Constraints with constant coefficients cost no order; the object is its name."""
    ball = at.PointMass("ball", 0.1, (0.6, 0.8))
    bars = falling().bodies
    joints = [at.Slider("bar.start", (1.0, 0.0)), at.Pin("bar.end", "ball.center")]
    scene = at.Scene("sliding", [*bars, ball], joints, gravity=GRAVITY)
    runs = [
        at.solve(
            scene, mesh=1, integrator=at.Esdirk(), dt=dt, t_end=0.04, output_dt=0.02, newton_tolerance=1e-13
        )
        for dt in (2e-3, 1e-3, 5e-4)
    ]
    one, two = (np.abs(coordinates(a) - coordinates(b)).max() for a, b in pairwise(runs))
    assert np.log2(one / two) == pytest.approx(4.0, abs=0.6)
    assert runs[0].run == Discretisation(
        1, integrator="esdirk", dt=2e-3, t_end=0.04, output_dt=0.02, newton_tolerance=1e-13
    )


def test_a_stage_that_is_not_found_says_when():
    scene = bar([at.Clamp("bar.start")], gravity=(0.0, -1e9))
    found = at.solve(scene, mesh=1, integrator="esdirk", dt=0.1, t_end=1.0)
    assert found.status.code == "diverged"
    assert len(found.t) < 11
    assert found.status.time is not None
    assert "a smaller dt than 0.1 s" in found.status.message


def test_a_preloaded_start_at_rest_stays():
    scene = falling()
    rest = at.solve_static(scene, mesh=2)
    found = at.solve(scene, mesh=2, integrator="esdirk", dt=1e-2, t_end=0.1, start=rest)
    assert np.abs(coordinates(found) - coordinates(found)[0]).max() < 1e-9


@pytest.mark.xfail(strict=True, reason="long steps of a stiff bar turn elements inside out")
@pytest.mark.parametrize("strain", [-1e-3, 1e-5, 1e-3])
@pytest.mark.parametrize("damping", [0.0, 1e-3])
@pytest.mark.parametrize("dt", [1e-2, 2e-2])
def test_a_stiff_bar_under_a_load_that_acts_at_once_comes_to_rest(strain, damping, dt):
    """F/EA, however long the step: bars had turned inside out, some with status ok, when stages started from F/m."""
    E, area = 7e10, 1e-4
    metal = at.Material(E, 2700.0, damping=damping)
    beam = at.Beam("bar", (0, 0), (1, 0), at.Rectangle(0.02, 0.005), metal)
    load = at.Force("bar.end", (strain * E * area, 0.0))
    scene = at.Scene("bar", [beam], [at.Clamp("bar.start", stretch="free")], [load])
    run = at.solve(scene, mesh=4, dt=dt, t_end=0.4, integrator="esdirk")
    assert run.status.ok
    # N of Green's strain: EA (e + e²/2) (1 + e) = F
    assert run.position("bar.end")[-1, 0] - 1.0 == pytest.approx(strain, rel=2.0 * abs(strain) + 1e-4)
