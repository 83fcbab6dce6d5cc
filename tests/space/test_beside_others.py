"""Space beside other programs: a cable by Exudyn, and two bars on ball joints by their own equations."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import anctmm as at

LENGTH, ELEMENTS, STEP, T_END = 1.0, 8, 1e-3, 0.5
DOWN, PUSH = np.array([0.0, 0.0, -9.81]), np.array([0.2, 0.5, 0.1])
ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1000.0)
ALONG = np.array([2.0, -1.0, 2.0]) / 3.0


def cable_of_exudyn(exu):
    """Positions of the free end of a cable on a ball joint, pushed there, at each tenth of a second."""
    from exudyn import itemInterface as items

    exu.config.printToConsole, exu.config.suppressWarnings = False, True
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    places = np.linspace(0.0, LENGTH, ELEMENTS + 1)[:, None] * ALONG
    nodes = [mbs.AddNode(items.NodePointSlope1(referenceCoordinates=[*r, *ALONG])) for r in places]
    for pair in pairwise(nodes):
        element = mbs.AddObject(
            items.ObjectANCFCable(
                nodeNumbers=list(pair), length=LENGTH / ELEMENTS, massPerLength=RUBBER.density * ROD.area,
                bendingStiffness=RUBBER.E * ROD.second_moment, axialStiffness=RUBBER.E * ROD.area,
            )
        )  # fmt: skip
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=element))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=list(DOWN)))
    ground = mbs.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0)
    )
    for k in range(3):
        own = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=k))
        mbs.AddObject(items.CoordinateConstraint(markerNumbers=[ground, own]))
    end = mbs.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[-1]))
    mbs.AddLoad(items.LoadForceVector(markerNumber=end, loadVector=list(PUSH)))
    kind = exu.OutputVariableType.Position
    sensor = mbs.AddSensor(
        items.SensorNode(nodeNumber=nodes[-1], storeInternal=True, outputVariableType=kind)
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write, settings.solution.sensors.writePeriod = False, 0.1
    time = settings.timeIntegration
    time.endTime, time.numberOfSteps, time.adaptiveStep = T_END, round(T_END / STEP), False
    time.generalizedAlpha.spectralRadius = 0.9
    time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-10, 1e-10
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    return mbs.GetSensorStoredData(sensor)[:, 1:]


def test_a_cable_on_a_ball_joint_moves_as_in_exudyn():
    exu = pytest.importorskip("exudyn")
    beam = at.Beam("cable", (0.0, 0.0, 0.0), tuple(LENGTH * ALONG), ROD, RUBBER)
    scene = at.Scene(
        "cable", [beam], [at.Pin("cable.start")], [at.Force("cable.end", tuple(PUSH))], tuple(DOWN)
    )
    found = at.solve(
        scene, mesh=ELEMENTS, integrator=at.GeneralizedAlpha(0.9), dt=STEP, t_end=T_END, output_dt=0.1,
        newton_tolerance=1e-12,
    )  # fmt: skip
    assert found.status.ok, found.status
    path = found.position("cable.end")
    assert np.linalg.norm(path[-1] - path[0]) > 0.3
    assert np.abs(path - cable_of_exudyn(exu)).max() < 1e-8


MASSES, LENGTHS, AXIAL = (1.2, 0.7), (0.8, 0.6), 1e-3
TILTED = (np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0), np.array([0.0, 0.6, -0.8]))
SPINS = (np.array([0.5, 2.0, 0.5]), np.array([-1.0, 0.8, 0.6]))


def bars_by_lagrange(t):
    """Positions of the last end: directions u, w on the unit sphere, by Lagrange's equations with multipliers."""
    (m, n), (a, b) = MASSES, LENGTHS
    mass = np.array([[m * a * a / 3.0 + n * a * a, 0.5 * n * a * b], [0.5 * n * a * b, n * b * b / 3.0]])
    force = np.array([(0.5 * m + n) * a * DOWN, 0.5 * n * b * DOWN])

    def rate(_, state):
        u, v = state.reshape(2, 2, 3)
        J = np.zeros((2, 6))
        J[0, :3], J[1, 3:] = u
        matrix = np.block([[np.kron(mass, np.eye(3)), J.T], [J, np.zeros((2, 2))]])
        right = np.concatenate([force.ravel(), -(v * v).sum(axis=1)])
        return np.concatenate([v.ravel(), np.linalg.solve(matrix, right)[:6]])

    start = np.array([TILTED, [np.cross(spin, u) for spin, u in zip(SPINS, TILTED, strict=True)]]).ravel()
    found = solve_ivp(rate, (0.0, t[-1]), start, "DOP853", t, rtol=1e-12, atol=1e-12)
    return a * found.y[:3].T + b * found.y[3:6].T


@pytest.mark.parametrize(("dt", "left", "off"), [(1e-3, {"newton_tolerance": 1e-13}, 1e-7), (1e-4, {}, 1e-6)])
def test_two_bars_on_ball_joints_move_by_their_own_equations(dt, left, off):
    place, velocity, bodies = np.zeros(3), np.zeros(3), []
    for k, (m, a, u, spin) in enumerate(zip(MASSES, LENGTHS, TILTED, SPINS, strict=True)):
        across = np.eye(3) - np.outer(u, u)
        turning, inertia = across @ spin, m * a * a / 12.0 * across + AXIAL * np.outer(u, u)
        ends = {"a": tuple(place), "b": tuple(place + a * u)}
        half = 0.5 * a * np.cross(spin, u)
        bodies.append(
            at.RigidBody(f"bar{k}", m, inertia, tuple(place + 0.5 * a * u), ends, velocity + half, turning)
        )
        place, velocity = place + a * u, velocity + 2.0 * half
    joints = [at.Pin("bar0.a"), at.Pin("bar0.b", "bar1.a")]
    scene = at.Scene("two bars", bodies, joints, gravity=tuple(DOWN))
    found = at.solve(scene, integrator="esdirk", dt=dt, t_end=1.0, output_dt=0.1, **left)
    assert found.status.ok, found.status
    path = found.position("bar1.b")
    assert np.linalg.norm(path[5] - path[0]) > 0.3
    assert np.abs(path - bars_by_lagrange(found.t)).max() < off
