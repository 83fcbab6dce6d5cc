"""Linear prediction of the changes of w, from which Newton's iteration of a stage starts."""

import numpy as np
import pytest
from control_costs import OTHERS
from random_graphs import Kinds, random_graph

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.joined import Joined, doubles_of, repeat_at_joints
from anctmm.integrators.adaptive.prediction import (
    DEPTH,
    FORGETS,
    LARGEST,
    LEAST,
    begin_prediction,
    learn,
    new_prediction,
    predict,
    take_back,
)
from anctmm.jit.compiling import uncompiled
from studies.regression import small_scenes

STEP, SCALE = 0.1, 2.0


class Motion:
    """A motion of a stick by solutions, one in a step, and what is predicted of it."""

    def __init__(self):
        self.chain = Chain(small_scenes.stick(), Discretisation(mesh=2))
        self.known = new_prediction(self.chain, 6)
        self.w = np.zeros(self.known.rates.shape[1])
        self.vectors = np.random.default_rng(3).normal(size=(4, self.w.size))

    def expected(self):
        w = self.w.copy()
        uncompiled(predict)(0, STEP, w, None, self.known)
        return w

    def go_to(self, w):
        """The error of the prediction, and that of no change."""
        found = np.abs(self.expected() - w).max(), np.abs(self.w - w).max()
        uncompiled(learn)(0, STEP, self.w, w, SCALE, self.chain.bodies.nodes, None, self.known)
        self.w = w
        return found


def cubic(vectors, n):
    return sum(a * (0.1 * n) ** k for k, a in enumerate(vectors))


def vibration(vectors, n):
    """Resolved, and one that changes its sign with each step."""
    return vectors[0] * np.cos(0.4 * n) + vectors[1] * np.sin(0.4 * n) + vectors[2] * (-0.9) ** n


@pytest.mark.parametrize("path", [cubic, vibration])
def test_motions_go_on(path):
    motion = Motion()
    found = np.array([motion.go_to(path(motion.vectors, n)) for n in range(40)])
    missed, kept = found[25:].max(axis=0)
    assert missed < 1e-2 * kept


def test_parts_are_those_of_weighted_least_squares():
    motion, rng = Motion(), np.random.default_rng(5)
    places = [np.zeros_like(motion.w)]
    for n in range(30):
        places.append(vibration(motion.vectors, n) + 0.1 * rng.normal(size=motion.w.size))
        motion.go_to(places[-1])
    sizes = np.ones_like(motion.w)
    sizes[: 2 * motion.chain.bodies.nodes] = 1.0 / SCALE
    changes = np.diff(places, axis=0) * sizes / STEP
    normal, right = np.zeros((DEPTH, DEPTH)), np.zeros(DEPTH)
    for n in range(len(changes)):
        last = np.zeros((DEPTH, motion.w.size))
        last[: min(n, DEPTH)] = changes[max(n - DEPTH, 0) : n][::-1]
        normal, right = FORGETS * normal + last @ last.T, FORGETS * right + last @ changes[n]
    normal[np.diag_indices(DEPTH)] *= 1.0 + LEAST
    motion.expected()
    np.testing.assert_allclose(motion.known.parts, np.linalg.solve(normal, right), rtol=1e-7, atol=1e-9)


def test_what_begins_after_rest_is_not_predicted_from_rounding():
    """From accelerations of 1e-17 parts of 1e15 were learned, and with them the next stages of a car at a bump."""
    motion, rng = Motion(), np.random.default_rng(7)
    for _ in range(20):
        motion.go_to(1e-17 * rng.normal(size=motion.w.size))
    largest = 1e-16
    for n in range(1, 30):
        w = motion.vectors[0] * np.sin(0.5 * n)
        change = np.abs(motion.expected() - motion.w).max()
        assert change <= 2.0 * LARGEST * largest  # by sizes of single components
        largest = max(largest, np.abs(w - motion.w).max())
        motion.go_to(w)


def test_a_refused_step_leaves_nothing_of_its_changes():
    motion = Motion()
    for n in range(20):
        motion.go_to(vibration(motion.vectors, n))
    before, w = motion.expected(), motion.w
    squares = motion.known.squares.copy()
    uncompiled(begin_prediction)(motion.known)
    for n in range(5):
        motion.go_to(motion.vectors[3] * n)
    uncompiled(take_back)(None, motion.known)
    motion.w, motion.known.squares[:] = w, squares
    np.testing.assert_allclose(motion.expected(), before, rtol=1e-12)


@pytest.mark.parametrize("number", range(12))
def test_ends_at_a_joint_have_the_same_unknowns(number):
    chain = Chain(*random_graph(number, Kinds(welds=True)))
    joined, rng = Joined(chain, free=True), np.random.default_rng(number + 100)
    x = joined.spread(rng.normal(size=joined.size)).ravel()
    doubles, off = doubles_of(chain), x.copy()
    off[doubles.place] += rng.normal(size=len(doubles.place))
    uncompiled(repeat_at_joints)(doubles, off)
    np.testing.assert_allclose(off, x, rtol=0.0, atol=1e-14)


def test_what_corrections_do_not_reach_does_not_grow():
    """Ends at a joint differ by rounding, and are corrected alike: a hundred times as much was left when they went on.

    With fixed steps it grew by a hundredth in a stage, and this triangle came apart.
    """
    chain = Chain(OTHERS["thrown_triangle"][0]().scene, Discretisation(mesh=2))
    joined, known, rng = Joined(chain), new_prediction(chain, 6), np.random.default_rng(0)
    vectors = rng.normal(size=(4, joined.size))
    w = joined.spread(vectors[0]).ravel()
    for n in range(1200):
        exact = sum(a * np.sin(0.05 * (k + 1) * n + k) for k, a in enumerate(vectors))
        expected = w.copy()
        uncompiled(predict)(0, STEP, expected, None, known)
        exact += 1e-3 * rng.normal(size=joined.size)
        correction = joined.spread(exact - joined.unknowns(expected.reshape(joined.shape)))
        found = expected + correction.ravel()
        uncompiled(learn)(0, STEP, w, found, SCALE, chain.bodies.nodes, None, known)
        w = found
    alike = joined.spread(joined.unknowns(w.reshape(joined.shape))).ravel()
    assert np.abs(w - alike).max() < 2e-13
