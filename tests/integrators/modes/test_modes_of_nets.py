"""Modes and stability of nets of springs between masses, by matrices that are written down."""

import numpy as np
import pytest

import anctmm as at


def net(count, stretch=1.0, gravity=(0.3, -9.81), columns=(0,)):
    """Masses in squares, springs along their sides and one diagonal, stretched so many times; columns that are held."""
    places = {(i, j): (0.1 * i, 0.1 * j) for i in range(count) for j in range(count)}
    masses = [at.PointMass(f"m{i}{j}", 0.1 + 0.01 * i, place) for (i, j), place in places.items()]
    pairs = [
        (one, (one[0] + x, one[1] + y))
        for one in places
        for x, y in [(1, 0), (0, 1), (1, 1)]
        if (one[0] + x, one[1] + y) in places
    ]
    springs = [
        at.Spring(
            "m{}{}.center".format(*a), "m{}{}.center".format(*b), stiffness=1e3,
            length=np.hypot(*np.subtract(places[b], places[a])) / stretch if stretch != 1.0 else None,
        )
        for a, b in pairs
    ]  # fmt: skip
    held = [at.Pin(f"m{i}{j}.center") for i in columns for j in range(count)]
    return at.Scene("net", masses, held, gravity=gravity, connectors=springs)


def frequencies(scene, positions):
    """Hz, ascending: of K = Σ k d dᵀ + (T/l)(1 − d dᵀ) between the masses that are not held."""
    names = [body.name for body in scene.bodies]
    number = {name: n for n, name in enumerate(names)}
    K = np.zeros((len(names), 2, len(names), 2))
    for spring in scene.connectors:
        a, b = (number[place.partition(".")[0]] for place in (spring.first, spring.second))
        apart = positions[b] - positions[a]
        length = np.hypot(*apart)
        along = np.outer(apart, apart) / length**2
        placed = np.hypot(*np.subtract(scene.bodies[b].position, scene.bodies[a].position))
        tension = spring.stiffness * (length - (placed if spring.length is None else spring.length))
        block = spring.stiffness * along + tension / length * (np.eye(2) - along)
        for i, j, sign in [(a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)]:
            K[i, :, j] += sign * block
    held = {joint.ends[0].partition(".")[0] for joint in scene.joints}
    free = [n for n, name in enumerate(names) if name not in held]
    root = np.repeat([scene.bodies[n].mass for n in free], 2) ** -0.5
    size = 2 * len(free)
    squares = np.linalg.eigvalsh(root[:, None] * K[free][:, :, free].reshape(size, size) * root)
    return np.sort(np.sign(squares) * np.sqrt(np.abs(squares))) / (2.0 * np.pi)


def start(scene):
    return np.array([body.position for body in scene.bodies])


@pytest.mark.parametrize("count", [3, 4, 5])
@pytest.mark.parametrize("gravity", [(0.0, 0.0), (0.3, -9.81)])
def test_a_net_without_tension_has_the_frequencies_of_its_matrix(count, gravity):
    """Their springs' stiffness across, mere rounding, hid all others: NaN, or 0 Hz, without a word."""
    scene = net(count, gravity=gravity)
    found = at.modes(scene, mesh=1, count=6).frequencies
    assert np.abs(found / frequencies(scene, start(scene))[:6] - 1.0).max() < 1e-9


@pytest.mark.parametrize("stretch", [1.0, 1.2])
def test_a_hanging_net_is_stable_and_vibrates_as_its_matrix_says(stretch):
    scene = net(4, stretch)
    rest = at.solve_static(scene, mesh=1, newton_tolerance=1e-10)
    assert rest.status.ok, rest.status
    positions = np.array([rest.position(f"{body.name}.center")[-1] for body in scene.bodies])
    wanted = frequencies(scene, positions)
    assert wanted[0] > 0.0
    found = at.modes(scene, mesh=1, count=6, about=rest).frequencies
    assert np.abs(found / wanted[:6] - 1.0).max() < 1e-6
    assert np.abs(found / frequencies(scene, start(scene))[:6] - 1.0).max() > 1e-3


@pytest.mark.parametrize(("stretch", "negative"), [(0.8, 0), (0.6, 1)])
def test_a_net_between_two_walls_buckles_as_its_matrix_says(stretch, negative):
    scene = net(4, stretch, (0.0, 0.0), columns=(0, 3))
    rest = at.solve_static(scene, mesh=1)
    positions = np.array([rest.position(f"{body.name}.center")[-1] for body in scene.bodies])
    assert (frequencies(scene, positions) < 0.0).sum() == negative
    assert rest.status == ("unstable" if negative else "ok")
    if negative:
        assert f"{negative} negative eigenvalue" in str(rest.status)
