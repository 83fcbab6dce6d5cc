"""Connectors whose places are kept: tangent solves and their inertia against direct ones of the undivided scene."""

import numpy as np
import pytest
from direct import compatible, direct, error, mass_of, scales, stiffness_of, torque_stiffness
from random_acting import asked_mechanism
from random_against import AGREE, judge
from random_graphs import Kinds, random_graph
from scipy.sparse import csc_array

import anctmm as at
from anctmm.discretise.chain import Chain
from anctmm.discretise.joined import Joined
from anctmm.discretise.junctions import couplings
from anctmm.forces.actuation import Actuation
from anctmm.forces.connectors import vectors_of
from anctmm.recursion.riccati import block_factors, factorize, links, solve

#: Positions along beams: ends, nodes of some meshes, and places within elements.
PLACES = (0.0, 0.2, 1 / 3, 0.5, 0.71, 1.0)
TIME = 0.01
#: Condition from which a stiffness is that of a mechanism.
SINGULAR = 1e12


def connected(seed):
    """A random graph of beams, and springs and rotational springs between any places of it."""
    scene, run = random_graph(seed, Kinds(bodies=(2, 12)))
    rng = np.random.default_rng([seed, 7])

    def place():
        return str(rng.choice([b.name for b in scene.bodies])), float(rng.choice(PLACES))

    found = []
    while len(found) < int(rng.integers(1, 9)):
        one, two = place(), place()
        if one == two or np.allclose(scene.place(one).position, scene.place(two).position):
            continue
        if rng.random() < 0.6:
            found.append(
                at.Spring(one, two, stiffness=float(rng.uniform(1.0, 1e4)), preload=float(rng.normal()))
            )
        else:
            found.append(at.RotationalSpring(one, two, stiffness=float(rng.uniform(0.1, 20.0)), preload=0.1))
    return at.Scene(scene.name, scene.bodies, scene.joints, scene.loads, scene.gravity, found), run


def chain_with(scene, run, few):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(couplings, "FEW", few)
        patch.setattr(couplings, "DIVIDED", few)
        chain = Chain(scene, run)
        assert bool(chain.segments.coupled) == (few == 0)
    return chain


def hessian(chain, q):
    """Second derivatives of the energy of all connectors by the coordinates of all nodes."""
    size = q.size
    index = np.arange(size).reshape(q.shape)
    total = csc_array((size, size))
    for n, connector in enumerate(chain.scene.connectors):
        G = np.zeros((4, size))
        for k, vector in enumerate(vectors_of(chain.scene, chain.bodies, connector)):
            for node, row, a, b in vector.terms:
                x, y = index[row, node], index[row + 1, node]
                G[2 * k, x] += a
                G[2 * k, y] -= b
                G[2 * k + 1, y] += a
                G[2 * k + 1, x] += b
        a, b = (G @ q.ravel()).reshape(2, 2)
        G = csc_array(G)
        total = total + G.T @ csc_array(of_vectors(connector, chain, n, a, b)) @ G
    return total


def of_vectors(connector, chain, n, a, b):
    """The same by the vectors of one, (4, 4)."""
    rest = [np.array(chain.scene.place(p).position) for p in connector.places]
    if isinstance(connector, at.Spring):
        d = b - a
        length = np.hypot(*d)
        along = np.outer(d, d) / length**2
        force = connector.stiffness * (length - np.hypot(*(rest[1] - rest[0]))) + connector.preload
        C = connector.stiffness * along + force / length * (np.eye(2) - along)
        return np.block([[C, -C], [-C, C]])
    turn = complex(*b) / complex(*a) / start_turn(connector, chain)
    moment = connector.stiffness * np.angle(turn) + connector.preload
    gradient = np.concatenate([[a[1], -a[0]] / (a @ a), [-b[1], b[0]] / (b @ b)])
    second = np.zeros((4, 4))
    for k, (x, y), sign in ((0, a, -1.0), (2, b, 1.0)):
        s = (x * x + y * y) ** 2
        second[k : k + 2, k : k + 2] = (
            sign / s * np.array([[2 * x * y, y * y - x * x], [y * y - x * x, -2 * x * y]])
        )
    return connector.stiffness * np.outer(gradient, gradient) + moment * second


def start_turn(connector, chain):
    q = chain.bodies.reference()
    one, two = (
        sum(complex(t.a, t.b) * complex(*q[t.row : t.row + 2, t.node]) for t in vector.terms)
        for vector in vectors_of(chain.scene, chain.bodies, connector)
    )
    return two / one / abs(two / one)


def moved(chain, fields, force):
    """Values of whole bodies at the nodes of a chain; a force on a node where a beam is cut acts on one part alone."""
    q = chain.flat(fields)
    for parts in chain.segments.parts.values() if force else ():
        for part in parts[1:]:
            q[:, chain.node((part.name, 0))] = 0.0
    return q


@pytest.mark.parametrize("weight", [1e7, 0.0])
@pytest.mark.parametrize("seed", range(40))
def test_tangent_solves_are_direct_ones(seed, weight):
    scene, run = connected(seed)
    whole = chain_with(scene, run, 1000)
    kept = chain_with(scene, run, 0)
    q = compatible(whole, 1e-3)
    f = np.random.default_rng(1).standard_normal(q.shape) * scales(whole)
    matrix = (
        weight * mass_of(whole)
        + stiffness_of(whole, q)
        + torque_stiffness(whole, q, TIME)
        + hessian(whole, q)
    )
    actuation = Actuation(kept.parts, kept.bodies, coupled=kept.segments.coupled)
    factors = block_factors(kept)
    with np.errstate(all="ignore"):  # mechanisms are singular
        negative = factorize(
            moved(kept, whole.by_body(q), False), kept.bodies.tables(), links(kept), weight, 1.0,
            actuation.loads(), actuation.load_table(np.array([TIME]))[0], factors,
        )  # fmt: skip
    T = Joined(whole).matrix
    A = (T.T @ matrix @ T).toarray()
    values = np.linalg.eigvalsh(A)
    with np.errstate(all="ignore"):
        found = kept.by_body(solve(factors, moved(kept, whole.by_body(f), True)))
    exact = direct(whole, matrix, f)
    condition = np.linalg.cond(equilibrated(A))
    if condition < SINGULAR:
        assert error(whole, whole.flat(found), exact) < max(1e-12, 1e-15 * condition)
        assert negative == (values < 0.0).sum()
    else:
        assert weight == 0.0  # a mechanism


def equilibrated(A):
    s = 1.0 / np.sqrt(np.abs(A.diagonal()))
    return s[:, None] * A * s


@pytest.mark.parametrize("seed", [10, 24, 39, 44, 84, 112, 115])
def test_mechanisms_move_as_the_global_dae_says(seed, monkeypatch):
    """Rigid bodies, guides, driven hinges, laws, loads that follow: wherever connectors act, on divided beams too."""
    monkeypatch.setattr(couplings, "FEW", 0)
    monkeypatch.setattr(couplings, "DIVIDED", 0)
    case = asked_mechanism(seed)
    assert len(Chain(case.scene, case.run).segments.coupled) > 1
    verdict = judge(seed, kind="mechanisms")
    assert verdict.verdict == AGREE, verdict
