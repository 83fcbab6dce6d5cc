"""OpenSees as a peer: orders, agreement with our own solver, limits, and what becomes of a process that ends."""

from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest

import anctmm as at
from reference import opensees
from reference.exact import solve_static
from studies.scenes import (
    cantilever_end_moment,
    cantilever_fall,
    cantilever_tip_force,
    four_bar,
    four_bar_moment,
)

L, SECTION, MATERIAL = 1.0, at.Rectangle(0.05, 0.05), at.Material(E=1e7, density=1000.0)
EI = MATERIAL.E * SECTION.second_moment
#: As it is called where it lacks something.
USUAL = {"mesh": 4, "dt": 2e-3, "t_end": 0.02}

needed = pytest.mark.skipif(
    not any(map(find_spec, opensees.PACKAGES)), reason="OpenSees (extra `peers`) is not installed"
)


def bar(name="bar", start=(0.0, 0.0), angle=0.0, length=L, **more):
    end = (start[0] + length * np.cos(angle), start[1] + length * np.sin(angle))
    return at.Beam(name, start, end, SECTION, MATERIAL, **more)


def frame():
    """A portal with a fork on its beam, one arm welded and the other hinged."""
    bodies = [
        bar("left", angle=np.pi / 2), bar("top", (0.0, L)), bar("right", (L, L), -np.pi / 2),
        bar("arm", (L, L), 0.4, 0.7), bar("flap", (L, L), -0.4, 0.6),
    ]  # fmt: skip
    joints = [
        at.Clamp("left.start"), at.Weld("left.end", "top.start"), at.Weld("top.end", "right.start", "arm.start"),
        at.Pin("right.start", "flap.start"), at.Pin("right.end"),
    ]  # fmt: skip
    return at.Scene("frame", bodies, joints, [at.Force("arm.end", (0.0, -1.0))], (0.0, -1.0))


def meshed(scene, *counts):
    return dict(zip([body.name for body in scene.beams], counts, strict=True))


def largest(one, other, probes):
    return max(np.linalg.norm(one.position(p) - other.position(p), axis=1).max() for p in probes)


# --- statics -------------------------------------------------------------------------------------------------


@needed
@pytest.mark.parametrize(("beam", "order", "level"), [("elastic", 2.0, 1.34e-5), ("nonlinear", 4.0, 1e-9)])
def test_equilibria_tend_to_the_elastica(beam, order, level):
    """The issue's 1e-5 at 64 elements is kept by the nonlinear beam; the linear one reaches 1.3e-5 by second order."""
    case = cantilever_tip_force(3.0)
    exact = solve_static(case.scene, "elastica")
    found = [opensees.solve_static(case.scene, mesh=n, beam=beam) for n in (16, 32, 64)]
    assert all(f.status.ok for f in found)
    errors = [
        np.linalg.norm(f.displacement("beam.end")[-1] - exact.displacement("beam.end")[-1]) / 2.0
        for f in found
    ]
    assert np.diff(np.log2(errors)) == pytest.approx([-order] * 2, abs=0.1)
    assert errors[-1] < level


@needed
def test_an_end_moment_rolls_up_half_a_turn_and_no_more():
    case = cantilever_end_moment()  # the end turns by π
    found = opensees.solve_static(case.scene, mesh=32)
    exact = solve_static(case.scene, "elastica")
    assert found.status.ok
    assert found.displacement("beam.end")[-1] == pytest.approx(exact.displacement("beam.end")[-1], abs=2e-7)
    whole = opensees.solve_static(cantilever_end_moment(2.0 * np.pi).scene, mesh=32)
    assert whole.status.code == "failed"
    assert "half a turn" in whole.status.message
    assert whole.t == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


@needed
def test_frames_with_branches_rest_where_ours_do():
    ours = at.solve_static(frame(), mesh=16)
    found = opensees.solve_static(frame(), mesh=16, load_steps=40)  # rounding decides which flap it finds
    assert found.status.ok
    way = max(np.linalg.norm(ours.displacement(p)[-1]) for p in ("arm.end", "flap.end"))
    for probe in ("arm.end", "flap.start", "top.start"):
        assert np.abs(found.displacement(probe)[-1] - ours.displacement(probe)[-1]).max() < 1e-4 * way
    # the hinged flap hangs; it rests upright, too, an equilibrium that OpenSees does not tell from a stable one
    hanging, upright = (s.position("flap.end")[-1] - s.position("flap.start")[-1] for s in (ours, found))
    assert hanging[1] < 0.0
    assert (
        np.abs(np.abs(upright) - np.abs(hanging)).max() < 1e-4 * way
    )  # its weight stretches it, or compresses it


# --- motion --------------------------------------------------------------------------------------------------


@needed
@pytest.mark.parametrize(
    ("beam", "at_128"), [("elastic", 2.5e-4), ("elastic-lumped", 2.5e-4), ("nonlinear", 2e-4)]
)
def test_a_fall_tends_to_ours(beam, at_128):
    case = cantilever_fall()
    run = {"dt": 1e-3, "t_end": case.t_end, "output_dt": case.output_dt}
    ours = at.solve(case.scene, mesh=48, quadrature="lobatto", **run)
    found = [
        opensees.solve(case.scene, mesh=n, beam=beam, newton_tolerance=1e-7, **run) for n in (16, 32, 128)
    ]
    assert all(f.status.ok for f in found)
    errors = [largest(f, ours, case.probes) / 2.0 for f in found]  # of the length
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.25)
    assert errors[2] < min(at_128, 0.2 * errors[1])


@needed
def test_a_four_bar_turns_by_half_a_turn_as_ours_does():
    case = four_bar()
    run = {"dt": 1e-3, "t_end": 0.95, "output_dt": case.output_dt}
    ours = at.solve(case.scene, mesh=meshed(case.scene, 4, 16, 4), quadrature="lobatto", **run)
    found = [
        opensees.solve(case.scene, mesh=meshed(case.scene, *mesh), **run) for mesh in ((2, 8, 2), (4, 16, 4))
    ]
    assert all(f.status.ok for f in found)
    errors = [largest(f, ours, case.probes) for f in found]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.25)
    assert errors[1] < 2e-4
    assert found[1].angle("crank", 0.0)[-1] == pytest.approx(case.scene.joints[0].angle(0.95)[0])


@needed
@pytest.mark.parametrize(("case", "t_end"), [(four_bar(), 0.9), (four_bar_moment(), 0.8)])
def test_steps_are_of_second_order(case, t_end):
    """With drives and with loads that vary: where they are taken in a step, and how it begins, decide the order."""
    mesh = meshed(case.scene, 2, 8, 2)
    found = [
        opensees.solve(case.scene, mesh=mesh, dt=dt, t_end=t_end, output_dt=0.05)
        for dt in (2.5e-3, 1.25e-3, 6.25e-4)
    ]
    differences = [largest(a, b, case.probes) for a, b in pairwise(found)]
    assert np.log2(differences[0] / differences[1]) == pytest.approx(2.0, abs=0.3)


# --- limits --------------------------------------------------------------------------------------------------


def test_a_clamp_that_turns_further_than_half_a_turn_is_refused():
    case = four_bar()
    found = opensees.solve(case.scene, mesh=2, dt=1e-2, t_end=1.2)
    assert found.status.code == "unsupported"
    assert "clamp 'crank.start' angle is more than half a turn at t = 1.01 s" in found.status.message
    assert len(found.t) == 0


@needed
def test_a_bar_that_swings_further_fails_by_name_and_keeps_its_history():
    spun = at.Scene("spun", [bar(velocity=lambda x: (0.0, 4.0 * L * x))], [at.Pin("bar.start")])
    found = opensees.solve(spun, mesh=4, dt=2e-3, t_end=1.0, output_dt=0.02)
    assert found.status.code == "failed"
    assert "half a turn" in found.status.message
    assert found.status.time == pytest.approx(np.pi / 4.0, abs=0.03)
    assert found.t[-1] == pytest.approx(np.pi / 4.0, abs=0.03)
    assert np.abs(found.angle("bar", 1.0)[-1]) < np.pi + 0.1


@pytest.mark.parametrize(
    ("scene", "options", "reason"),
    [
        (
            at.Scene("s", [bar()], [at.Clamp("bar.start")]),
            {"integrator": "zhai"},
            "has generalized-alpha alone",
        ),
        (
            at.Scene("s", [at.Beam("bar", (0, 0), (L, 0), SECTION, at.Material(1e7, 1000.0, damping=1e-3))]),
            {},
            "damping is 0.001 s for body 'bar'",
        ),
        (
            at.Scene("s", [bar()], loads=[at.LineLoad("bar", (0.0, -1.0))]),
            {},
            "a model in OpenSees cannot do LineLoad",
        ),
        (at.Scene("s", [bar()]), {"element": "rigid", "mesh": 1}, "rigid"),
    ],
)
def test_what_it_cannot_do_is_unsupported(scene, options, reason):
    found = opensees.solve(scene, **USUAL | options)
    assert found.status.code == "unsupported"
    assert reason in found.status.message


# --- its process ---------------------------------------------------------------------------------------------


def ending(tmp_path, monkeypatch, command):
    """A process that does its job and ends otherwise than it should."""
    worker = tmp_path / "worker.py"
    text, end = opensees.WORKER.read_text(), '    (folder / "end.json")'
    assert end in text
    worker.write_text(text.replace(end, f"    {command}\n{end}"))
    monkeypatch.setattr(opensees, "WORKER", worker)


@needed
@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "exit code -11"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
    ],
)
def test_a_process_that_ends_is_a_row_with_what_was_computed(tmp_path, monkeypatch, command, reason):
    ending(tmp_path, monkeypatch, command)
    scene = at.Scene("s", [bar()], [at.Clamp("bar.start")], gravity=(0.0, -9.81))
    found = opensees.solve(scene, **USUAL)
    assert found.status.code == "failed"
    assert "the process of OpenSees was ended" in found.status.message
    assert reason in found.status.message
    assert len(found.t) == 11
