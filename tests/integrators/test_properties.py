"""What must hold for every scene: nothing depends on direction, place, cut, order or units; what motion keeps.

Scenes are drawn at random (`random_scenes`), by default the same few each time; `--hypothesis-profile thorough` tries
many new ones.
"""

from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st
from random_graphs import Kinds, random_graph
from random_scenes import EIGHTHS, VECTORS, Drawn, rows, structures
from samples import frequency_of, system_of

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.scene import Beam, Clamp, Force, Material, Scene, Torque, Weld
from anctmm.model.sections import Section
from anctmm.solve import solve, solve_static

EPS = float(np.finfo(float).eps)
TOLERANCE = 1e-12
#: What Newton's iteration leaves of a correction, by its tolerance, at most.
LEFT = 1.0
#: A disturbance far above rounding, and small enough that its effect is proportional to it.
DISTURBANCE = 1e-10
#: Steps of a run, Δt ω_max (explicit below the limit of 2, implicit above), and the longest Δt, s.
METHODS = {"zhai": (200, 1.0, 1.0), "generalized-alpha": (40, 30.0, 5e-4), "statics": (1, 1.0, 1.0)}
MOTIONS = ("zhai", "generalized-alpha")
every_method = pytest.mark.parametrize("method", METHODS)


def systems(method, **options):
    """Scenes for a method: statics needs those that can rest."""
    return structures(**options) if method == "statics" else rows(**options)


def frequency(drawn):
    """Highest frequency of small vibrations, rad/s."""
    return frequency_of(drawn.scene, mesh=drawn.mesh, element=drawn.element)


def answer(method, drawn, dt, **options):
    """Solution of a drawn scene by a method."""
    if method == "statics":
        found = solve_static(drawn.scene, mesh=drawn.mesh, element=drawn.element, newton_tolerance=TOLERANCE)
    else:
        run = {
            "dt": dt,
            "t_end": METHODS[method][0] * dt,
            "newton_tolerance": TOLERANCE,
            "integrator": method,
        }
        run |= {"mesh": drawn.mesh, "element": drawn.element, "check_stability": False, **options}
        found = solve(drawn.scene, **run)
    assert found.status.ok, found.status
    return found


def stiffness(drawn):
    """Acceleration of the whole scene by the force that strains its stiffest element by 1 m, 1/s²."""
    bodies = drawn.scene.bodies
    mass = sum(b.material.density * b.section.area * b.length for b in bodies)
    return max(b.material.E * b.section.area * drawn.mesh[b.name] / b.length for b in bodies) / mass


def histories(solution):
    """Coordinates of every body, (n, nodes, vectors, 2), gradients times the element length: all in m."""
    out = {}
    for name, field in solution.fields.items():
        q = field.coordinates.copy()
        q[:, :, 1:] *= field.length / (q.shape[1] - 1)
        out[name] = q
    return out


def apart(one, two):
    """Largest difference of the histories of the bodies of two solutions, m."""
    return max(float(np.abs(one[name] - two[name]).max()) for name in one)


class Trial:
    """A drawn scene solved by a method, and how far rounding may lead two equal runs apart.

    Rounding of coordinates of size R changes an element's strain by ε R/l and its force by ε EA R/l. A force of this
    size (with `DISTURBANCE` for ε), steady and spread over the scene as gravity, shows what such an error comes to:
    N² for what is free to drift, the condition of what rests, and growth by instability are all in it.
    """

    def __init__(self, method, drawn, furthest=1.0):
        self.method, self.drawn = method, drawn
        w = frequency(drawn)
        steps, part, longest = METHODS[method]
        self.dt = min(part / w, longest) if w > 0.0 else 1e-3
        self.solution = answer(method, drawn, self.dt)
        self.history = histories(self.solution)
        self.reach = reach = max(furthest, *(float(np.abs(h).max()) for h in self.history.values()))
        effect = 0.0
        for direction in ((1.0, 0.0), (0.0, 1.0)):
            kick = DISTURBANCE * reach * stiffness(drawn) * np.array(direction)
            scene = replace(drawn.scene, gravity=tuple(drawn.scene.gravity + kick))
            kicked = histories(answer(method, replace(drawn, scene=scene), self.dt))
            effect = max(effect, apart(self.history, kicked))
        precision = 1.5 * EPS
        if method == "generalized-alpha":  # what Newton's iteration may leave is far above rounding
            length = sum(b.length for b in drawn.scene.bodies)
            precision = max(LEFT * TOLERANCE, 32.0 * EPS * (1.0 + reach / length))
        self.tolerance = precision * (reach * steps + effect / DISTURBANCE)

    def same(self, other, back, second=1.0):
        """Assert that another scene, with times in another unit, has the same history once mapped back."""
        found = back(histories(answer(self.method, other, self.dt * second)))
        self.within(apart(self.history, found))

    def within(self, difference):
        """Assert that a difference, m, is rounding."""
        note(f"apart {difference:.2e} m, allowed {self.tolerance:.2e} m")
        assert difference <= self.tolerance


# --- place and direction -----------------------------------------------------------------------------------


class Placing:
    """Turn by an angle after a reflection at the x axis (hand −1) or none (hand 1), then a shift."""

    def __init__(self, angle, hand, shift):
        c, s = cos(angle), sin(angle)
        self.hand, self.shift = hand, np.array(shift)
        self.matrix = np.array([[c, -s * hand], [s, c * hand]])

    def vector(self, v):
        (a, b), (c, d) = self.matrix
        return (a * v[0] + b * v[1], c * v[0] + d * v[1])

    def point(self, p):
        return tuple(map(float, self.vector(p) + self.shift))

    def of_time(self, value, apply):
        return (lambda t: apply(value(t))) if callable(value) else apply(value)

    def body(self, b):
        velocity = b.velocity and (lambda s: self.vector(b.velocity(s)))
        return replace(b, start=self.point(b.start), end=self.point(b.end), velocity=velocity)

    def joint(self, j):
        if isinstance(j, Clamp) and j.angle is not None:
            return Clamp(j.end, lambda t: tuple(self.hand * x for x in j.angle(t)))
        return j

    def load(self, load):
        if isinstance(load, Force):
            return Force(load.end, self.of_time(load.value, self.vector))
        return Torque(load.end, self.of_time(load.value, lambda m: self.hand * m))

    def scene(self, scene):
        return replace(
            scene,
            bodies=map(self.body, scene.bodies),
            joints=map(self.joint, scene.joints),
            loads=map(self.load, scene.loads),
            gravity=self.vector(scene.gravity),
        )

    def back(self, found):
        """Histories of the scene before; a reflection also turns the sense of r_y."""
        out = {name: q.copy() for name, q in found.items()}
        for q in out.values():
            q[:, :, 0] -= self.shift
            q[:, :, 2:] *= self.hand
        return {name: q @ self.matrix for name, q in out.items()}


placings = st.builds(
    Placing, EIGHTHS, st.sampled_from([1.0, -1.0]), VECTORS.map(lambda v: (4.0 * v[0], 4.0 * v[1]))
)


@every_method
@given(data=st.data(), placing=placings)
def test_turned_moved_and_mirrored_scenes_have_turned_moved_and_mirrored_histories(method, data, placing):
    drawn = data.draw(systems(method))
    Trial(method, drawn, furthest=16.0).same(replace(drawn, scene=placing.scene(drawn.scene)), placing.back)


# --- cut, order, units -------------------------------------------------------------------------------------


@every_method
@given(data=st.data())
def test_a_body_cut_at_a_node_into_two_welded_ones_moves_as_before(method, data):
    drawn = data.draw(systems(method, least=2))
    body = data.draw(st.sampled_from(drawn.scene.bodies))
    n = drawn.mesh[body.name]
    k = data.draw(st.integers(1, n - 1))
    middle = tuple((1 - k / n) * a + k / n * b for a, b in zip(body.start, body.end, strict=True))

    def part(name, start, end, first, last):
        velocity = body.velocity and (lambda s: body.velocity(first + s * (last - first)))
        return replace(body, name=name, start=start, end=end, velocity=velocity)

    ends = {f"{body.name}.start": "one.start", f"{body.name}.end": "two.end"}
    bodies = [b for b in drawn.scene.bodies if b is not body]
    bodies += [part("two", middle, body.end, k / n, 1.0), part("one", body.start, middle, 0.0, k / n)]
    joints, loads = renamed(drawn.scene, lambda end: ends.get(end, end))
    joints.append(Weld("one.end", "two.start"))
    mesh = {**drawn.mesh, "one": k, "two": n - k}
    element = {**drawn.element, "one": drawn.element[body.name], "two": drawn.element[body.name]}
    del mesh[body.name], element[body.name]

    def joined(found):
        one, two = found.pop("one"), found.pop("two")
        return {**found, body.name: np.concatenate([one, two[:, 1:]], axis=1)}

    scene = replace(drawn.scene, bodies=bodies, joints=joints, loads=loads)
    Trial(method, drawn).same(Drawn(scene, mesh, element), joined)


def renamed(scene, name):
    """Joints and loads of a scene at ends of other names."""

    def joint(j):
        if isinstance(j, Clamp):
            return Clamp(name(j.end), j.angle)
        return type(j)(*map(name, j.ends), grounded=j.grounded)

    return [joint(j) for j in scene.joints], [replace(f, end=name(f.end)) for f in scene.loads]


#: How far rounding, or what Newton's iteration leaves, may lead two equal runs of 40 or 10 steps apart, relative.
ROUNDING = {"zhai": 1e-11, "generalized-alpha": 1e-9}


def short_run(scene, run, integrator):
    """A quarter of the stable step, or steps with Newton's iterations."""
    if integrator == "zhai":
        dt = min(0.5 / max(frequency_of(scene, mesh=run.mesh, element=run.element), 1.0), 1e-3)
        return Discretisation(run.mesh, run.element, integrator=integrator, dt=dt, t_end=40 * dt)
    return Discretisation(run.mesh, run.element, dt=1e-3, t_end=1e-2, newton_tolerance=TOLERANCE)


def backwards(body):
    velocity = body.velocity and (lambda s: body.velocity(1.0 - s))
    return replace(body, start=body.end, end=body.start, velocity=velocity)


def places(solution, names, turned=()):
    return np.stack([
        solution.displacement((n, 1.0 - s if n in turned else s)) for n in names for s in (0.0, 0.3, 1.0)
    ])  # fmt: skip


@pytest.mark.parametrize("integrator", ROUNDING)
@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_order_direction_and_root_of_trees_and_loops_do_not_matter(integrator, seed):
    """Another order of bodies is another root, and other junctions that are kept."""
    scene, run = random_graph(seed, Kinds(bodies=(2, 12)))
    run, rng = short_run(scene, run, integrator), np.random.default_rng(seed)
    turned = {b.name for b in scene.bodies if rng.random() < 0.5}

    def name(end):
        body, side = end.split(".")
        return f"{body}.{'end' if (side == 'start') == (body in turned) else 'start'}"

    bodies = [backwards(b) if b.name in turned else b for b in scene.bodies]
    bodies, joints, loads = (
        [things[i] for i in rng.permutation(len(things))] for things in (bodies, *renamed(scene, name))
    )
    other = replace(scene, bodies=bodies, joints=joints, loads=loads)
    one, two = solve(scene, run), solve(other, run)
    assert (one.status.ok, two.status.ok) == (True, True)
    names = [b.name for b in scene.bodies]
    first, second = places(one, names), places(two, names, turned)
    assert np.abs(first - second).max() < ROUNDING[integrator] * max(1e-3, np.abs(first).max())


@every_method
@given(data=st.data(), powers=st.tuples(*[st.integers(-30, 30)] * 3))
def test_units_do_not_matter(method, data, powers):
    """Lengths, masses and times in units up to 2^±30 apart: only exponents change."""
    drawn = data.draw(systems(method))
    metre, kilogram, second = (2.0**p for p in powers)
    newton = kilogram * metre / second**2

    def body(b):
        s, m = b.section, b.material
        return Beam(
            b.name,
            tuple(metre * x for x in b.start),
            tuple(metre * x for x in b.end),
            Section(s.area * metre**2, s.second_moment * metre**4, s.fourth_moment * metre**6),
            Material(m.E * newton / metre**2, m.density * kilogram / metre**3, m.poisson),
            b.velocity and (lambda x: scaled(b.velocity(x), metre / second)),
        )

    def joint(j):
        if isinstance(j, Clamp) and j.angle is not None:
            return Clamp(j.end, lambda t: scaled(j.angle(t / second), 1.0, 1.0 / second, 1.0 / second**2))
        return j

    def load(f):
        unit = newton if isinstance(f, Force) else newton * metre
        value = (lambda t: scaled(f.value(t / second), unit)) if callable(f.value) else scaled(f.value, unit)
        return type(f)(f.end, value)

    scene = Scene(
        "scaled",
        map(body, drawn.scene.bodies),
        map(joint, drawn.scene.joints),
        map(load, drawn.scene.loads),
        scaled(drawn.scene.gravity, metre / second**2),
    )
    Trial(method, drawn).same(
        replace(drawn, scene=scene),
        lambda found: {name: q / metre for name, q in found.items()},
        second=second,
    )


def scaled(value, *factors):
    """A number or each of some numbers times a factor, or times its own."""
    if not isinstance(value, tuple):
        return value * factors[0]
    return tuple(
        x * f for x, f in zip(value, factors * len(value) if len(factors) == 1 else factors, strict=True)
    )


# --- what motion keeps -------------------------------------------------------------------------------------


def masses(drawn):
    """Mass matrix of each body over its nodal vectors, (nodes vectors, nodes vectors), kg and m."""
    out = {}
    for mesh in system_of(drawn.scene, mesh=drawn.mesh, element=drawn.element).mesh.beams:
        M, k = mesh.element.mass, mesh.vectors
        found = out[mesh.body.name] = np.zeros((mesh.nodes * k,) * 2)
        for i in range(mesh.nodes - 1):
            found[i * k : (i + 2) * k, i * k : (i + 2) * k] += M
    return out


def vectors(solution):
    """Nodal vectors of each body, (n, nodes vectors, 2)."""
    return {n: f.coordinates.reshape(len(solution.t), -1, 2) for n, f in solution.fields.items()}


@pytest.mark.parametrize("method", MOTIONS)
@given(drawn=rows(supports=("free",)))
def test_centre_of_mass_of_free_chains_falls_as_a_point(method, drawn):
    """Linear momentum is kept exactly: both integrators find a constant acceleration's parabola."""
    case = Trial(method, drawn)
    start = case.solution.fields
    moment, momentum, mass = 0.0, 0.0, 0.0
    for name, q in vectors(case.solution).items():
        M, k = masses(drawn)[name], case.solution.fields[name].coordinates.shape[2]
        weights = M[::k].sum(axis=0)  # a translation moves the positions alone
        moment = moment + np.einsum("i,nic->nc", weights, q)
        momentum = momentum + weights @ start[name].velocities[0].reshape(-1, 2)
        mass += weights[::k].sum()
    t = case.solution.t[:, None]
    parabola = moment[0] / mass + t * momentum / mass + 0.5 * t**2 * drawn.scene.gravity
    case.within(np.abs(moment / mass - parabola).max())


def angular_momentum(drawn, solution):
    """Of each pair of neighbouring outputs, Σ q_n × M (q_{n+1} − q_n)/Δt about the origin, (n − 1,), N m s."""
    total = 0.0
    for name, q in vectors(solution).items():
        speed = np.diff(q, axis=0) / np.diff(solution.t)[:, None, None]
        p = np.einsum("ij,njc->nic", masses(drawn)[name], speed)
        total = total + (q[:-1, :, 0] * p[:, :, 1] - q[:-1, :, 1] * p[:, :, 0]).sum(axis=1)
    return total


@given(drawn=rows(supports=("free",)))
def test_zhai_keeps_the_angular_momentum_of_free_chains(drawn):
    """Exactly, at ψ = φ = ½: Störmer and Verlet's q_n × M q_{n+1} changes by Δt² q_n × F(q_n) = 0 a step."""
    drawn = replace(drawn, scene=replace(drawn.scene, gravity=(0.0, 0.0)))
    case = Trial("zhai", drawn)
    momentum = angular_momentum(drawn, case.solution)
    mass = sum(b.material.density * b.section.area * b.length for b in drawn.scene.bodies)
    # an error of the place that grows as N²/2 has grown by 2/N of itself in a step
    case.within(np.abs(momentum - momentum[0]).max() * case.dt * len(momentum) / (2.0 * mass * case.reach))


# --- equilibrium -------------------------------------------------------------------------------------------


@given(drawn=structures(kinds=("shear",), torques=False))
def test_halving_shear_elements_never_raises_the_potential_energy_at_rest(drawn):
    """The space of the coarse mesh lies in that of the fine one, and five Gauss points integrate the energy exactly.

    So equilibrium is a minimum over more. Nothing promises it for cables: their energy is no polynomial, no rule
    integrates it exactly, and the error of a rule changes with the mesh.
    """
    fine = replace(drawn, mesh={name: 2 * n for name, n in drawn.mesh.items()})
    coarse, halved = (answer("statics", d, None).energy for d in (drawn, fine))
    one, two = (e.strain[-1] + e.potential[-1] for e in (coarse, halved))
    rounding = EPS * sum(b.material.E * b.section.area * b.length for b in drawn.scene.bodies)
    note(f"{one} J, halved {two} J, rounding {rounding} J")
    assert two < 0.0
    assert two <= one + rounding
