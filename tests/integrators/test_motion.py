"""What holds for both integrators of ANC-TMM: direction and order of bodies, joints, loads, drives, output."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from samples import INTEGRATORS, KINDS, SOFT, SQUARE, bar, frequency_of, gap, inner, row_scene

from anctmm.errors import StartWarning
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Scene, Torque, Weld
from anctmm.solve import solve

GRAVITY = (0.0, -9.81)
every_kind = pytest.mark.parametrize("kind", KINDS)
every_integrator = pytest.mark.parametrize("integrator", INTEGRATORS)


def move(scene, integrator="zhai", kind="cable", t_end=0.04, **options):
    """A short motion, explicit at a third of the stable step."""
    options = {"mesh": 2, "element": kind, **options}
    dt = options.pop("dt", None)
    if dt is None:
        frequency = frequency_of(scene, mesh=options["mesh"], element=kind)
        dt = t_end / 40 if integrator != "zhai" else t_end / (4 * int(np.ceil(t_end * frequency / 2.7)))
    run = {
        "integrator": integrator,
        "dt": dt,
        "t_end": t_end,
        "output_dt": t_end / 4,
        "newton_tolerance": 1e-12,
    }
    result = solve(scene, **{**run, **options})
    assert result.status.ok, result.status
    return result


# --- direction and order -----------------------------------------------------------------------------------


@every_integrator
@every_kind
@pytest.mark.parametrize("angle", [pi, -3.0])
def test_weld_keeps_its_angle(kind, integrator, angle):
    """Directions of the two sides as complex numbers; at π the second body lies back on the first."""
    motion = move(row_scene("clamp", [("weld", angle)], "free", gravity=GRAVITY), integrator, kind)
    one, two = (motion.fields[b].coordinates[:, i, 1] @ [1.0, 1.0j] for b, i in (("b0", -1), ("b1", 0)))
    assert np.abs(two / one - np.exp(1j * angle)).max() < 1e-12
    assert np.abs(motion.displacement("b1.end")).max() > 1e-3


# --- free bodies, several chains, one element ---------------------------------------------------------------


@every_integrator
def test_chains_that_nothing_joins_do_not_see_each_other(integrator):
    """A driven pendulum of shear elements, a falling cable and a two-bar frame, together and alone."""
    frame = row_scene("clamp", [("weld", 1.0)], "free")
    hung = Beam("hung", (0.0, 3.0), (1.0, 3.0), SQUARE, SOFT)
    loose = Beam("loose", (0.0, 5.0), (1.0, 5.0), SQUARE, SOFT, lambda s: (0.0, s))
    parts = [
        Scene("loose", [loose], gravity=GRAVITY),
        Scene("hung", [hung], [Clamp("hung.end", Quintic(1.0, 0.1))], gravity=GRAVITY),
        replace(frame, gravity=GRAVITY),
    ]
    kinds = {"hung": "shear", "loose": "cable", "b0": "cable", "b1": "cable"}
    joints = [*parts[1].joints, *frame.joints]
    together = Scene("all", [loose, hung, *frame.bodies], joints, gravity=GRAVITY)
    options = {"dt": 1e-5 if integrator == "zhai" else 1e-3, "integrator": integrator}
    whole = move(together, element=kinds, **options)
    for part in parts:
        alone = move(part, element={b.name: kinds[b.name] for b in part.bodies}, **options)
        for body in part.bodies:
            assert gap(whole, alone, 0.9, body.name) < 1e-12


# --- supports in the middle, initial velocities --------------------------------------------------------------


@every_integrator
@every_kind
def test_clamped_gradients_take_no_velocity(kind, integrator):
    """A velocity that grows from the clamp would turn it: the clamp decides about its node's gradients."""
    with pytest.warns(StartWarning, match=r"Clamp.*axis 1 of 'bar\.start' changes at"):
        scene = bar([Clamp("bar.start")], velocity=lambda s: (-0.8 * s, 0.6 * s))
    motion = move(scene, integrator, kind)
    q = motion.fields["bar"].coordinates
    assert np.abs(q[:, 0] - q[0, 0]).max() < 1e-14
    assert np.abs(motion.displacement("bar.end")).max() > 0.01


@every_integrator
@every_kind
def test_welded_gradients_move_as_one(kind, integrator):
    """A motion that is grounded at the weld, where both bodies turn as one."""
    bodies = [
        Beam("a", (0.0, 0.0), (0.5, 0.0), SQUARE, SOFT, lambda s: (0.0, (s - 1.0) * (2.0 - s))),
        Beam("b", (0.5, 0.0), (1.0, 0.0), SQUARE, SOFT, lambda s: (0.0, s * (1.0 + 3.0 * s))),
    ]
    motion = move(Scene("turn", bodies, [Weld("a.end", "b.start", grounded=True)]), integrator, kind)
    one, two = motion.fields["a"].coordinates[:, -1], motion.fields["b"].coordinates[:, 0]
    assert np.abs(one - two).max() < 1e-14


# --- loads and drives ----------------------------------------------------------------------------------------


@every_integrator
@every_kind
@pytest.mark.parametrize("turned", [(0,), (1,)])
def test_driven_clamp_at_either_end_and_in_either_direction(turned, kind, integrator):
    """The driven clamp first or last in the chain: the same motion, held exactly, and the work closes the balance."""
    drive = Quintic(pi / 3, 0.1)

    def scene(first):
        row = row_scene("free", [("pin", 0.4)], "free", turned=turned)
        joints = [*row.joints, Clamp(inner(0, turned), drive)]
        return replace(row, joints=joints, bodies=row.bodies if first else row.bodies[::-1])

    one, two = (move(scene(first), integrator, kind, t_end=0.1) for first in (True, False))
    for body in ("b0", "b1"):
        assert gap(one, two, 0.6, body) < 1e-11
    for motion in (one, two):
        clamp = motion.fields["b0"].coordinates[:, -1 if 0 in turned else 0]
        direction = clamp[:, 1] @ [1.0, 1.0j] * (-1.0 if 0 in turned else 1.0)
        assert np.abs(direction - np.exp(1j * (0.4 + drive(motion.t)[0]))).max() < 1e-13
        assert np.abs(clamp[:, 0]).max() < 1e-15
        assert np.abs(motion.energy.balance).max() < 0.02 * motion.energy.work.max()


@pytest.mark.parametrize(("integrator", "factor"), [("zhai", 1), ("generalized-alpha", 20)])
def test_balance_with_drives_and_loads_closes_with_the_square_of_the_step(integrator, factor):
    """Work of a clamp, a torque and a force of time; ρ∞ = 1 takes nothing."""
    loads = [Torque("b1.end", Pulse(0.2, 0.1)), Force("b0.end", lambda t: (5.0 * t, 0.0))]
    row = row_scene("free", [("pin", 0.4)], "free", loads=loads, gravity=GRAVITY)
    scene = replace(row, joints=[*row.joints, Clamp("b0.start", Quintic(1.0, 0.2))])
    sizes = []
    for dt in (factor * 4e-5, factor * 2e-5):
        options = {"dt": dt, "output_dt": 0.008, "spectral_radius": 1.0}
        motion = move(scene, integrator, t_end=0.08, **options)
        sizes.append(np.abs(motion.energy.balance).max() / motion.energy.kinetic.max())
    assert sizes[0] / sizes[1] == pytest.approx(4.0, rel=0.15)
    assert sizes[1] < 1e-3


# --- output ------------------------------------------------------------------------------------------------


@every_integrator
def test_outputs_hold_the_end_of_a_run_that_is_no_whole_number_of_them(integrator):
    scene, dt = bar([Clamp("bar.start")], gravity=GRAVITY), 1e-5
    every, some = (
        solve(scene, mesh=2, integrator=integrator, dt=dt, t_end=25 * dt, output_dt=n * dt) for n in (1, 10)
    )
    assert some.t == pytest.approx([0.0, 10 * dt, 20 * dt, 25 * dt], abs=1e-18)
    assert every.t.size == 26
    kept = [0, 10, 20, 25]
    assert np.array_equal(some.position("bar", 0.7), every.position("bar", 0.7)[kept])
    for name, series in vars(some.energy).items():
        assert np.array_equal(series, getattr(every.energy, name)[kept])
