"""A slider-crank with a flexible rod: motion, guide force and drive torque by three codes.

The crank is driven through a whole turn, the rod swings and bends, the slider is a mass on a line. With equal meshes
and steps all three solve one set of discrete equations: in ANC-TMM the forces come from the equilibrium of the
elements, in Exudyn they are Lagrange multipliers, measured by its own sensors.
"""

import numpy as np
import pytest

import anctmm as at
from anctmm.discretise.discretisation import discretise
from reference import global_dae

SECTION, SOFT = at.Rectangle(0.01, 0.01), at.Material(E=1e9, density=2700.0)
TURN = at.Quintic(2.0 * np.pi, 0.5)
DRIVE, GUIDE = at.Clamp("crank.start", TURN), at.Slider("rod.end")
RUN = {"mesh": {"crank": 2, "rod": 4}, "t_end": 0.5, "output_dt": 0.01}
#: Exudyn's Newton iteration bounds residuals, N: as far as rounding lets it.
RESIDUALS = (1e-10, 2e-9)
#: Of implicit steps' drive torques: ours take the drive's own acceleration, the others that of the step.
DRIVE_LEVEL = 2e-6
IMPLICIT = RUN | {"dt": 1e-3, "spectral_radius": 0.9}


def slider_crank():
    """The crank stands upright; the rod leads down to the slider on the x axis."""
    crank = at.Beam("crank", (0, 0), (0, 0.15), SECTION, SOFT)
    rod = at.Beam("rod", (0, 0.15), (0.4, 0), SECTION, SOFT)
    slider = at.PointMass("slider", 0.1, (0.4, 0))
    joints = [DRIVE, at.Pin("crank.end", "rod.start"), GUIDE, at.Pin("rod.end", "slider.center")]
    return at.Scene("slider-crank", [crank, rod, slider], joints, gravity=(0.0, -9.81))


def compared(ours, theirs, motion, guide, drive):
    """Motion (m), guide force (of the largest) and drive torque (of the largest)."""
    assert ours.status.ok, ours.status
    assert theirs.status.ok, theirs.status
    assert at.compare(ours, theirs, ["crank.end", ("rod", 0.5), "slider.center"]).error < motion
    for joint, component, level in ((GUIDE, 1, guide), (DRIVE, 2, drive)):
        a, b = (s.reaction(joint)[:, component] for s in (ours, theirs))
        assert np.abs(a).max() > 0.1
        assert np.abs(a - b).max() < level * np.abs(a).max()


def test_implicit_steps_agree_with_the_global_solver():
    scene = slider_crank()
    options = IMPLICIT | {"newton_tolerance": 1e-13}
    compared(at.solve(scene, **options), global_dae.solve(scene, **options), 1e-8, 1e-8, DRIVE_LEVEL)


def test_explicit_steps_agree_with_the_global_solver():
    scene = slider_crank()
    options = RUN | {"integrator": "zhai", "dt": 2e-5, "t_end": 0.05}
    compared(at.solve(scene, **options), global_dae.solve(scene, **options), 1e-9, 1e-8, 1e-8)


def test_implicit_steps_agree_with_exudyn():
    exudyn_cable = pytest.importorskip("reference.exudyn_cable")
    pytest.importorskip("exudyn")
    scene = slider_crank()
    ours = at.solve(scene, **IMPLICIT, newton_tolerance=1e-13)
    compared(ours, exudyn_cable.solve(scene, **IMPLICIT, tolerances=RESIDUALS), 1e-8, 1e-8, DRIVE_LEVEL)


def test_forces_are_exudyns_multipliers():
    """The drive's moment is that of the multipliers of both components of the gradient that it turns."""
    pytest.importorskip("exudyn")
    scene, run = slider_crank(), discretise(None, IMPLICIT | {"newton_tolerance": 1e-13})
    ours = at.solve(scene, run)
    guide, drive = multipliers(scene, run)
    found = ours.reaction(GUIDE)[:, 1]
    assert np.abs(guide - found).max() < 1e-8 * np.abs(found).max()
    angle = TURN(ours.t)[0] + 0.5 * np.pi
    moment = -np.sin(angle) * drive[:, 0] + np.cos(angle) * drive[:, 1]
    found = ours.reaction(DRIVE)[:, 2]
    assert np.abs(moment - found).max() < DRIVE_LEVEL * np.abs(found).max()


def multipliers(scene, run):
    """Forces of Exudyn's constraints on the slider's y (n,) and on the crank's gradient (n, 2)."""
    from reference.exudyn.cable import Cables
    from reference.exudyn.joints import add_joint
    from reference.exudyn.model import Model, load_exudyn, silence

    exu, beams = load_exudyn(), Cables(scene, run)
    with silence(exu):
        model, items = Model(exu, scene, beams, run, False), {}
        for joint in scene.joints:
            first = model.mbs.systemData.NumberOfObjects()
            add_joint(model, joint)
            items[joint] = range(first, model.mbs.systemData.NumberOfObjects())
        (guide,), drive = items[GUIDE], items[DRIVE][-2:]
        force = {
            "outputVariableType": exu.OutputVariableType.Force,
            "storeInternal": True,
            "writeToFile": False,
        }
        sensors = [
            model.mbs.AddSensor(model.items.SensorObject(objectNumber=number, **force))
            for number in (guide, *drive)
        ]
        model.assemble()
        model.mbs.SolveDynamic(beams.settings(model, RESIDUALS))
        stored = [model.mbs.GetSensorStoredData(sensor)[:, 1] for sensor in sensors]
    return -stored[0], -np.stack(stored[1:], axis=1)
