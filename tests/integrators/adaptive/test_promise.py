"""What a tolerance promises, on scenes drawn at random: how far the largest error is above the one asked for."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from random_scenes import Push, rows

import anctmm as at
from anctmm.model.drives import Pulse

T_END, OUTPUTS = 0.3, 30
#: Change of gravity, of itself, that shows how a motion amplifies errors, and more than it may amplify them.
DISTURBANCE, WILD = 1e-6, 10.0
#: Beginnings and length of short pushes on all bodies, s, and their size, N/m: they show the same where gravity does
#: little. What they cause grows 0.1 … 0.9 times as fast as in the first 20 ms, where errors are not amplified.
PUSHED, SHORT, SIZE, GROWTH = (T_END / 15, T_END / 3), 1e-3, 1e-6, 1.0
TOLERANCES = (1e-2, 1e-3, 1e-4)
#: Largest error at any time, over the tolerance. What is promised, within three times, is the rms error: peaks of steps
#: of second order were 4.2, 3.6 and 3.2 at 1e-2 in three of some 700 runs. A search for the worst among thousands finds
#: beams that driven clamps fold, whose motion amplifies errors in ways that no push shows: see `tolerance.md`.
LARGEST = {"generalized-alpha": 5.0, "esdirk": 3.0}


@st.composite
def eventful(draw):
    """Rows of cables, and now and then a push that is short beside the run and at no round time."""
    drawn = draw(
        rows(supports=("pin", "clamp", "hub")).filter(lambda d: set(d.element.values()) == {"cable"})
    )
    if draw(st.booleans()):
        return drawn
    t0, width = T_END * draw(st.integers(1, 60)) / 67, T_END * draw(st.sampled_from([0.2, 0.02, 0.002]))
    pulse = Pulse(draw(st.sampled_from([1.0, 4.0])), width)

    def shifted(t):
        return pulse(np.asarray(t) - t0) if np.ndim(t) else float(pulse(t - t0))

    history = Push((1.0, 0.5), at.History(shifted, (t0, t0 + width)) if draw(st.booleans()) else shifted)
    loads = [*drawn.scene.loads, at.Force(f"{draw(st.sampled_from(drawn.scene.bodies)).name}.end", history)]
    return replace(drawn, scene=replace(drawn.scene, loads=loads))


def amplifies(scene, reference, probes, options, begin):
    """Whether what a short push causes grows faster than by going on as it does in the first 20 ms."""
    push = Pulse(SIZE, SHORT)

    def load(t):
        return 0.6 * float(push(t - begin)), 0.8 * float(push(t - begin))

    history = at.History(load, (begin, begin + SHORT))
    loads = [*scene.loads, *(at.LineLoad(b.name, history) for b in scene.bodies)]
    pushed = at.solve(replace(scene, loads=loads), **options)
    moved = np.max([np.abs(pushed.displacement(p) - reference.displacement(p)) for p in probes], axis=(0, 2))
    seen = round((begin + 0.02) / T_END * OUTPUTS)
    going_on = moved[seen] * (T_END - begin) / (reference.t[seen] - begin)
    return moved.max() > GROWTH * going_on


def errors(drawn, integrator):
    """Error of each tolerance over it, in the largest displacement, where a reference knows it well enough."""
    scene, probes = drawn.scene, [(b.name, f) for b in drawn.scene.bodies for f in (0.25, 0.5, 0.75, 1.0)]
    options = {"mesh": drawn.mesh, "element": "cable", "t_end": T_END, "output_dt": T_END / OUTPUTS}
    fine = {"dt": T_END / OUTPUTS / 400, "newton_tolerance": 1e-9}
    reference = at.solve(scene, **fine, **options)
    assume(reference.status.ok)
    assume(max(np.abs(reference.displacement(p)).max() for p in probes) > 1e-6)  # something moves
    coarser = at.solve(scene, **fine | {"dt": T_END / OUTPUTS / 200}, **options)
    gravity = tuple((1.0 + DISTURBANCE) * g for g in scene.gravity)
    disturbed = at.solve(replace(scene, gravity=gravity), **fine, **options)
    assume(at.compare(disturbed, reference, probes).largest < WILD * DISTURBANCE)
    assume(not any(amplifies(scene, reference, probes, fine | options, begin) for begin in PUSHED))
    known = at.compare(coarser, reference, probes).largest
    found = {}
    for tolerance in TOLERANCES:
        if known < 0.3 * tolerance:
            run = at.solve(
                scene, tolerance=tolerance, newton_tolerance=1e-8, integrator=integrator, **options
            )
            assert run.status.ok, run.status
            found[tolerance] = at.compare(run, reference, probes).largest / tolerance
    return found


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(drawn=eventful())
def test_errors_at_any_time_stay_near_what_is_asked(integrator, drawn):
    found = errors(drawn, integrator)
    assert all(ratio <= LARGEST[integrator] for ratio in found.values()), found
