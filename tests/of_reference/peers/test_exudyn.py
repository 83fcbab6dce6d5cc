"""Exudyn as the peer: its element is ours, its integrators are known, and it says what it cannot do."""

import sys
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.optimize import minimize

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import DiscretisationError, MeshError, UnknownOptionError
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld, distance
from anctmm.model.sections import Circle, Rectangle
from anctmm.results.metrics import compare
from reference import exudyn_cable, exudyn_reissner

pytest.importorskip("exudyn")

L, EI, EA = 2.0, 1e9 * 0.01 * 0.005**3 / 12, 1e9 * 0.01 * 0.005
RHO_A, G = 2000.0 * 0.01 * 0.005, 9.81
TIGHT = (1e-9, 1e-11)
QUADRATURES = ("full", "reduced", "lobatto")
RULES = {"full": ("gauss", 5, 3), "reduced": ("gauss", 4, 2), "lobatto": ("lobatto", 3, 2)}
PEERS = (exudyn_cable, exudyn_reissner)


def beam(name="beam", start=(0.0, 0.0), end=(L, 0.0), poisson=0.0, velocity=None):
    return Beam(name, start, end, Rectangle(0.01, 0.005), Material(1e9, 2000.0, poisson), velocity)


def cantilever(*loads, gravity=0.0, angle=None, poisson=0.0):
    return Scene("cantilever", [beam(poisson=poisson)], [Clamp("beam.start", angle)], loads, (0.0, -gravity))


def four_bar(first, *loads):
    def link(name, start, end, diameter, mass, E):
        section = Circle(diameter)
        density = mass / (section.area * distance(start, end))
        return Beam(name, start, end, section, Material(E, density))

    A, B, D = (0.0, 0.0), (0.2, 0.0), (0.2 + 0.3 * sqrt(3), 0.0)
    C = (0.2 + 0.9 * cos(pi / 6), 0.9 * sin(pi / 6))
    bodies = [
        link("crank", A, B, 0.04, 0.6811, 1e9),
        link("coupler", B, C, 0.05, 2.474, 5e6),
        link("follower", C, D, 0.03, 1.470, 5e8),
    ]
    pins = [Pin("crank.end", "coupler.start"), Pin("coupler.end", "follower.start"), Pin("follower.end")]
    return Scene("four-bar", bodies, [first, *pins], loads)


class Cantilever:
    """The cantilever of cables once more, in a few lines that share nothing with the project's elements."""

    def __init__(self, elements, quadrature="full"):
        kind, axial, bending = RULES[quadrature]
        self.l = L / elements
        x, w = self.gauss(axial) if kind == "gauss" else (np.array([0.0, 0.5, 1.0]), np.array([1, 4, 1]) / 6)
        self.B, self.w = self.shapes(x)[1], EA * self.l * w
        x, w = self.gauss(bending)
        _, self.D, self.C = self.shapes(x)
        self.v = EI * self.l * w
        self.rows = 2 * np.arange(elements)[:, None] + np.arange(4)
        size = 2 * elements + 2
        self.mass, self.weight, self.reference = np.zeros((size, size)), np.zeros(size), np.zeros((size, 2))
        x, w = self.gauss(4)
        N = self.shapes(x)[0]
        for i in self.rows:
            self.mass[np.ix_(i, i)] += RHO_A * self.l * (N.T * w) @ N
            self.weight[i] += RHO_A * self.l * (w @ N)
        self.reference[::2, 0], self.reference[1::2, 0] = np.linspace(0.0, L, elements + 1), 1.0

    @staticmethod
    def gauss(points):
        x, w = np.polynomial.legendre.leggauss(points)
        return (x + 1) / 2, w / 2

    def shapes(self, x):
        l, one = self.l, np.ones_like(x)  # noqa: E741
        N = [1 - 3 * x**2 + 2 * x**3, l * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, l * (x**3 - x**2)]
        B = [6 * (x**2 - x) / l, 1 - 4 * x + 3 * x**2, 6 * (x - x**2) / l, 3 * x**2 - 2 * x]
        C = [(12 * x - 6) / l**2, (6 * x - 4) / l, (6 - 12 * x) / l**2, (6 * x - 2) / l]
        return np.array(N).T, np.array(B).T, np.array(C).T * one[:, None]

    def curvature(self, q):
        b, c = self.D @ q, self.C @ q
        s = (b * b).sum(-1)
        return b, c, s, (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0]) / s

    def energy(self, q):
        q = q[self.rows]
        b = self.B @ q
        strain, curvature = np.sqrt((b * b).sum(-1)) - 1, self.curvature(q)[3]
        return 0.5 * ((strain**2 @ self.w).sum() + (curvature**2 @ self.v).sum())

    def element_force(self, q):
        b = self.B @ q
        r = np.sqrt((b * b).sum(-1))
        force = self.B.T @ ((self.w * (r - 1) / r)[..., None] * b)
        b, c, s, k = self.curvature(q)
        by_b = np.stack([c[..., 1], -c[..., 0]], -1) - 2 * k[..., None] * b
        by_c = np.stack([-b[..., 1], b[..., 0]], -1)
        moment = (self.v * k / s)[..., None]
        return force + self.D.T @ (moment * by_b) + self.C.T @ (moment * by_c)

    def force(self, q):
        force = np.zeros_like(q)
        np.add.at(force, self.rows, self.element_force(q[self.rows]))
        return force

    def tangent(self, q):
        steps = 1e-30j * np.eye(8).reshape(8, 1, 4, 2)
        columns = self.element_force(q[self.rows][None] + steps).imag / 1e-30
        K = np.zeros((q.size, q.size))
        for e, i in enumerate(self.rows):
            c = (2 * i[:, None] + np.arange(2)).ravel()
            K[np.ix_(c, c)] += columns[:, e].reshape(8, 8).T
        return K

    def hub(self, theta):
        """Clamped node on a hub turned by theta."""
        return np.array([[0.0, 0.0], [cos(theta), sin(theta)]])

    def generalized_alpha(self, gravity, rho, dt, steps, angle=lambda t: 0.0):
        """Arnold & Brüls (2007), algorithm 1; the clamped node is prescribed by its position alone."""
        am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        gamma, load = 0.5 + af - am, np.outer(self.weight, [0.0, -gravity])
        beta = 0.25 * (gamma + 0.5) ** 2
        to_a, to_v = (1 - am) / (dt**2 * beta * (1 - af)), gamma / (dt * beta)
        q, free = self.reference.copy(), np.s_[2:]
        v, a = np.zeros_like(q), np.zeros_like(q)
        a[free] = np.linalg.solve(self.mass[free, free], (load - self.force(q))[free])
        algorithmic, history = a.copy(), [q.copy()]
        mass = np.kron(self.mass, np.eye(2))
        for n in range(steps):
            q += dt * v + dt**2 * (0.5 - beta) * algorithmic
            v += dt * (1 - gamma) * algorithmic
            algorithmic = (af * a - am * algorithmic) / (1 - am)
            q += dt**2 * beta * algorithmic
            v += dt * gamma * algorithmic
            a[:] = 0.0
            correction = np.zeros_like(q)
            correction[:2] = self.hub(angle((n + 1) * dt)) - q[:2]
            for _ in range(12):
                q += correction
                v += to_v * correction
                a += to_a * correction
                algorithmic += (1 - af) / (1 - am) * to_a * correction
                if 0.0 < np.abs(correction[free]).max() < 1e-12:
                    break
                residual = (self.mass @ a + self.force(q) - load)[free].ravel()
                matrix = (mass * to_a + self.tangent(q))[4:, 4:]
                correction = np.zeros_like(q)
                correction[free] = -np.linalg.solve(matrix, residual).reshape(-1, 2)
            history.append(q.copy())
        return np.array(history)


def coordinates(solution, body="beam"):
    q = solution.fields[body].coordinates
    return q.reshape(len(q), -1, 2)


@pytest.mark.parametrize("quadrature", QUADRATURES)
def test_the_check_itself_has_a_force_that_is_the_gradient_of_its_energy(quadrature):
    beam, rng = Cantilever(3, quadrature), np.random.default_rng(1)
    q = beam.reference + 0.2 * rng.standard_normal(beam.reference.shape)
    direction = rng.standard_normal(q.shape)
    slope = beam.energy(q + 1e-30j * direction).imag / 1e-30
    assert slope == pytest.approx((beam.force(q) * direction).sum(), rel=1e-13)


@pytest.mark.parametrize("quadrature", QUADRATURES)
def test_small_tip_load_gives_euler_bernoulli(quadrature):
    P = 1e-6
    rest = exudyn_cable.solve_static(cantilever(Force("beam.end", (0.0, -P))), mesh=2, quadrature=quadrature)
    assert rest.status.ok, rest.status
    assert rest.position("beam", 1.0)[-1, 1] == pytest.approx(-P * L**3 / (3 * EI), rel=1e-8)


@pytest.mark.parametrize("quadrature", QUADRATURES)
def test_static_cantilever_is_the_minimum_of_the_cable_energy(quadrature):
    P, check = 3 * EI / L**2, Cantilever(3, quadrature)
    scene = cantilever(Force("beam.end", (0.0, -P)))
    rest = exudyn_cable.solve_static(scene, mesh=3, quadrature=quadrature, load_steps=8)
    assert rest.status.ok, rest.status
    np.testing.assert_allclose(rest.t, np.linspace(0.0, 1.0, 9), atol=1e-12)

    def full(x):
        return np.concatenate([check.reference[:2], x.reshape(-1, 2)])

    def energy(x):
        return check.energy(full(x)) + P * full(x)[-2, 1]

    def gradient(x):
        g = check.force(full(x))
        g[-2, 1] += P
        return g[2:].ravel()

    x = coordinates(rest)[4, 2:].ravel()
    found = minimize(
        energy, x, jac=gradient, hess=lambda x: check.tangent(full(x))[4:, 4:], method="trust-exact",
        options={"gtol": 1e-10},
    )  # fmt: skip
    x = found.x - np.linalg.solve(check.tangent(full(found.x))[4:, 4:], gradient(found.x))
    assert np.abs(coordinates(rest)[-1] - full(x)).max() < 1e-9


def test_end_moment_rolls_up_a_circle():
    angle = pi / 2
    rest = exudyn_cable.solve_static(cantilever(Torque("beam.end", angle * EI / L)), mesh=16)
    tip = L / angle * np.array([sin(angle), 1 - cos(angle)])
    assert rest.position("beam", 1.0)[-1] == pytest.approx(tip, abs=2e-6)


@pytest.mark.parametrize(("order", "elements", "error"), [(1, 32, 5e-4), (2, 8, 1e-6)])
def test_reissner_beam_tends_to_timoshenko(order, elements, error):
    P, shear = 1e-6, 1e9 / 2.6 * 0.01 * 0.005
    scene = cantilever(Force("beam.end", (0.0, -P)), poisson=0.3)
    options = {"mesh": elements, "order": order, "shear_factor": 1e-4}
    rest = exudyn_reissner.solve_static(scene, **options)
    exact = -P * L**3 / (3 * EI) - P * L / (1e-4 * shear)
    assert rest.position("beam", 1.0)[-1, 1] == pytest.approx(exact, rel=error)


@pytest.mark.parametrize(("quadrature", "rho"), [("full", 0.9), ("lobatto", 0.6)])
def test_generalized_alpha_is_arnold_and_bruels(quadrature, rho):
    """Algorithmic acceleration a₀ at the start, M a = F at the end of each step: nothing else gives 1e-9."""
    ours = Cantilever(8, quadrature).generalized_alpha(G, rho, 1e-3, 1000)
    run = Discretisation(mesh=8, quadrature=quadrature, spectral_radius=rho, dt=1e-3, t_end=1.0)
    peer = exudyn_cable.solve(cantilever(gravity=G), run, tolerances=TIGHT)
    assert peer.status.ok, peer.status
    error = np.abs(coordinates(peer) - ours)
    assert error[:, ::2].max() < 1e-9 * L  # positions
    assert error[:2].max() < 1e-12  # one step, before Newton's errors add up
    assert np.abs(ours[:, -2, 1]).max() > 0.5 * L


def test_prescribed_coordinates_enter_by_their_position_alone():
    """Their rates and accelerations are those of the integrator's formulas, not the drive's."""
    drive = Quintic(turn=pi / 2, duration=1.0)
    ours = Cantilever(4).generalized_alpha(0.0, 0.9, 1e-3, 400, lambda t: float(drive(t)[0]))
    peer = exudyn_cable.solve(cantilever(angle=drive), mesh=4, dt=1e-3, t_end=0.4, tolerances=(1e-9, 1e-10))
    assert peer.status.ok, peer.status
    assert np.abs(coordinates(peer) - ours).max() < 1e-9 * L
    assert np.abs(ours[-1] - ours[0]).max() > 0.1


@pytest.mark.parametrize("peer", PEERS)
def test_falling_cantilever(peer):
    run = Discretisation(mesh=16, dt=1e-3, t_end=1.0, output_dt=0.03, spectral_radius=1.0)
    fall = peer.solve(cantilever(gravity=G), run)
    assert fall.status.ok, fall.status
    assert fall.cost.steps == 1000
    assert 1000 <= fall.cost.newton_iterations < 8000
    assert 1 <= fall.cost.factorizations < 1000
    np.testing.assert_array_equal(fall.t, run.times(run.output_steps))
    assert fall.t[[1, -2, -1]] == pytest.approx([0.03, 0.99, 1.0], abs=1e-15)
    assert fall.position("beam", 0.0) == pytest.approx(np.zeros_like(fall.position("beam", 0.0)), abs=1e-12)


def test_quadratures_differ_and_converge():
    scene, differences = cantilever(gravity=G), []
    for mesh in (8, 16):
        full, reduced = (
            exudyn_cable.solve(scene, mesh=mesh, quadrature=rule, dt=2e-3, t_end=0.6)
            for rule in ("full", "reduced")
        )
        differences.append(compare(full, reduced, probes=["beam.end"]).error)
    assert 1e-2 > differences[0] > differences[1] > 1e-7


@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("first", ["angle", "moment"])
def test_four_bar(peer, first):
    driven = first == "angle"
    clamp, pin = Clamp("crank.start", Quintic(2 * pi, 2.0)), Pin("crank.start")
    scene = four_bar(clamp) if driven else four_bar(pin, Torque("crank.start", Pulse(2.0, 1.0)))
    run = peer.solve(scene, mesh={"crank": 2, "coupler": 8, "follower": 2}, dt=2e-3, t_end=2.4)
    assert run.status.ok, run.status
    assert run.cost.steps == 1200
    for one, two in (("crank", "coupler"), ("coupler", "follower")):
        assert np.abs(run.position(one, 1.0) - run.position(two, 0.0)).max() < 1e-9
    assert np.abs(run.position("follower", 1.0) - run.position("follower", 1.0)[0]).max() < 1e-9
    if driven:
        after = run.position("crank", 1.0)[run.t > 2.0]
        assert np.abs(after - [0.2, 0.0]).max() < 1e-2


def test_drives_known_and_unknown_to_exudyn_are_the_same():
    """Quintic and Pulse are compiled into expressions; any other callable is set at each step."""
    quintic, pulse = Quintic(2 * pi, 2.0), Pulse(2.0, 1.0)
    options = {"mesh": 2, "dt": 2e-3, "t_end": 0.4, "output_dt": 0.1}
    pairs = [
        (four_bar(Clamp("crank.start", quintic)), four_bar(Clamp("crank.start", lambda t: quintic(t)))),
        (
            four_bar(Pin("crank.start"), Torque("crank.start", pulse), Force("crank.end", (0.0, 1.0))),
            four_bar(
                Pin("crank.start"),
                Torque("crank.start", lambda t: pulse(t)),
                Force("crank.end", lambda t: (0.0, 1.0)),
            ),
        ),
    ]
    for known, unknown in pairs:
        one, two = (exudyn_cable.solve(scene, **options) for scene in (known, unknown))
        assert one.status.ok
        assert two.status.ok
        assert compare(one, two, probes=["coupler.end"]).error < 1e-9


@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("bend", [0.0, 1.0])
def test_weld_at_any_angle_and_bodies_in_either_direction(peer, bend):
    corner, tip = (1.0, 0.0), (1.0 + cos(bend), sin(bend))

    def scene(reverse):
        ends = (tip, corner) if reverse else (corner, tip)
        weld = Weld("one.end", "two.end" if reverse else "two.start")
        bodies = [beam("one", (0.0, 0.0), corner), beam("two", *ends)]
        return Scene("bent", bodies, [Clamp("one.start"), weld], gravity=(0.0, -G))

    along, back = (peer.solve_static(scene(r), mesh=4) for r in (False, True))
    assert along.position("two", 1.0)[-1] == pytest.approx(back.position("two", 0.0)[-1], abs=1e-9)
    assert along.position("two", 0.25)[-1] == pytest.approx(back.position("two", 0.75)[-1], abs=1e-9)
    if bend == 0.0:
        whole = peer.solve_static(cantilever(gravity=G), mesh=8)
        assert along.position("two", 1.0)[-1] == pytest.approx(whole.position("beam", 1.0)[-1], abs=1e-9)
    moving = peer.solve(scene(True), mesh=4, dt=1e-3, t_end=0.2, output_dt=0.1)
    assert moving.status.ok
    assert np.abs(moving.position("one", 1.0) - moving.position("two", 1.0)).max() < 1e-9


@pytest.mark.parametrize("peer", PEERS)
def test_free_and_pinned_bodies_in_one_scene(peer):
    """A thrown, spinning beam keeps its momenta; a pendulum beside it keeps its pivot."""
    thrown = beam("thrown", (0.0, 1.0), (1.0, 1.0), velocity=lambda s: (0.5, 2.0 + 4.0 * (s - 0.5)))
    scene = Scene("two", [thrown, beam("hung", (0, 0), (1, 0))], [Pin("hung.start")], gravity=(0.0, -G))
    run = peer.solve(scene, mesh=2, spectral_radius=1.0, dt=1e-3, t_end=0.1, output_dt=0.01)
    assert run.status.ok, run.status
    middle = 0.5 * (run.position("thrown", 0.0) + run.position("thrown", 1.0))
    t = run.t
    assert middle == pytest.approx(np.column_stack([0.5 + 0.5 * t, 1 + 2 * t - G * t**2 / 2]), abs=2e-5)
    turn = np.arctan2(*(run.position("thrown", 1.0) - middle)[-1, ::-1])
    assert turn == pytest.approx(0.4, abs=1e-4)
    assert np.abs(run.position("hung", 0.0)).max() < 1e-10


@pytest.mark.parametrize("peer", PEERS)
def test_unsupported_scenes_say_why(peer):
    free = cantilever()
    free = Scene("free", free.bodies, [Clamp("beam.start", stretch="free")])
    for scene, more, named in ((cantilever(), {"integrator": "zhai"}, "explicit"), (free, {}, "stretch")):
        answer = peer.solve(scene, mesh=2, dt=1e-5, t_end=1e-3, **more)
        assert answer.status == "unsupported"
        assert named in answer.status.message
        assert len(answer.t) == 0
        assert answer.cost.steps == 0


def test_scenes_that_call_python_are_known():
    known = four_bar(Clamp("crank.start", Quintic(2 * pi, 2.0)))
    assert not exudyn_cable.python_callbacks(known)
    assert exudyn_cable.python_callbacks(
        four_bar(Clamp("crank.start", lambda t: (0.0 * t, 0.0 * t, 0.0 * t)))
    )


def test_without_exudyn(monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    for peer in PEERS:
        for answer in (peer.solve(cantilever(), mesh=2), peer.solve_static(cantilever(), mesh=2)):
            assert answer.status == "unsupported"
            assert "pip install 'anctmm[peers]'" in answer.status.message


def test_bad_options_raise_before_any_work():
    scene = cantilever(gravity=G)
    with pytest.raises(UnknownOptionError, match="quadrature"):
        exudyn_cable.solve(scene, mesh=2, quadrature="none")
    with pytest.raises(MeshError, match="beam"):
        exudyn_cable.solve(scene, mesh={"rod": 2})
    with pytest.raises(DiscretisationError, match="relative tolerance"):
        exudyn_cable.solve(scene, mesh=2, tolerances=(0.0, 1e-9))
    with pytest.raises(DiscretisationError, match="load_steps"):
        exudyn_cable.solve_static(scene, mesh=2, load_steps=0)
    with pytest.raises(DiscretisationError, match="order"):
        exudyn_reissner.solve(scene, mesh=2, order=3)


def test_newton_that_fails_keeps_the_history_until_then():
    answer = exudyn_cable.solve(cantilever(gravity=1e5 * G), mesh=8, dt=0.05, t_end=1.0)
    assert answer.status == "failed"
    assert 0.0 < answer.status.time < 1.0
    assert "smaller dt" in answer.status.message
    assert 1 < len(answer.t) < 21
    assert answer.t[-1] < answer.status.time
    assert np.isfinite(answer.position("beam", 1.0)).all()


def test_tolerances_below_rounding_fail_and_say_so():
    scene = four_bar(Pin("crank.start"), Torque("crank.start", Pulse(2.0, 1.0)))
    answer = exudyn_cable.solve(scene, mesh=8, dt=1e-3, t_end=0.01, tolerances=(1e-7, 1e-9))
    assert answer.status == "failed"
    assert "absolute tolerance" in answer.status.message
    assert exudyn_cable.solve(scene, mesh=8, dt=1e-3, t_end=0.01).status.ok


def test_statics_of_a_free_body_fail():
    answer = exudyn_cable.solve_static(Scene("free", [beam()], gravity=(0.0, -G)), mesh=2)
    assert answer.status == "failed"
    assert "hold every body" in answer.status.message


def test_forces_are_those_of_cables_whatever_element_is_named():
    """Reactions of a solution that named shear elements raised an error of NumPy."""
    scene = cantilever(Force("beam.end", (0.0, -1.0)))
    cables, asked = (exudyn_cable.solve_static(scene, mesh=4, element=e) for e in ("cable", "shear"))
    assert asked.run.element == "cable"
    support = asked.reaction(scene.joints[0])
    assert np.array_equal(support, cables.reaction(scene.joints[0]))
    assert support[-1, 1] == pytest.approx(1.0, abs=1e-6)
