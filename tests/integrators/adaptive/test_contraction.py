"""What a first correction leaves is told by others: by the way since the matrix, the length of the step, its square."""

from types import SimpleNamespace

import numpy as np
import pytest

from anctmm.integrators.adaptive import contraction
from anctmm.integrators.adaptive.step_control import FACTORED, PROGRESS
from anctmm.integrators.implicit.newton import _expected

pytestmark = pytest.mark.interpreted
#: Rate of the motion, 1/s, and the step, s.
RATE, H = 2.0, 0.01


class Run:
    """Solutions one after the other, whose corrections and renewals are given."""

    def __init__(self):
        self.known = contraction.new_contraction()
        self.newton = SimpleNamespace(
            counts=np.zeros(3, np.int64), history=np.zeros(25), expected=np.array([1.0, 0.0, 0.0])
        )
        self.progress = np.zeros(len(PROGRESS))

    def expected(self, t, h=H):
        contraction.expect_contraction(t, h, RATE, self.newton, self.progress, self.known)
        return self.newton.expected.copy()

    def solve(self, t, sizes, h=H, new=False):
        """A solution at t: what was expected of its first correction; then it is learned from."""
        self.newton.counts[2] = new
        told = self.expected(t, h)
        self.newton.counts[1] += new
        self.newton.counts[2] = 0
        self.newton.history[:] = np.pad(sizes, (0, 25 - len(sizes)))
        contraction.learn_contraction(t, h, 1e-12, self.newton, self.progress, self.known)
        return told


def test_nothing_is_expected_before_it_was_seen():
    run = Run()
    kept, new, sizes = run.solve(0.0, [1e-4, 1e-9], new=True)
    assert (kept, new, sizes) == (1.0, 0.0, 0.0)
    assert run.solve(H, [1e-4])[0] == 1.0


def test_a_kept_matrix_contracts_in_proportion_to_the_way_and_is_trusted_no_further_than_seen():
    run = Run()
    run.solve(0.0, [1e-4, 1e-9], new=True)
    over_way = 0.3
    run.solve(H, [1e-4, 1e-4 * over_way * RATE * H])
    for times in (1.0, 1.4):
        expected = run.expected(times * H)[0]
        assert expected == pytest.approx(contraction.SAFE * over_way * RATE * times * H)
    assert run.expected(1.6 * H)[0] == 1.0


def test_steps_of_another_length_leave_their_part_which_is_not_taken_for_that_of_the_way():
    run = Run()
    run.solve(0.0, [1e-4, 1e-9], new=True)
    run.solve(H, [1e-4, 1e-8])
    before = run.known[contraction.OF_WAY]
    other = 1.03 * H
    of_length = 1.03**2 - 1.0
    assert run.solve(H, [1e-4, 1e-4 * of_length], h=other)[0] == pytest.approx(of_length, rel=0.1)
    assert run.known[contraction.OF_WAY] <= before
    assert run.progress[FACTORED] == H


def test_a_new_matrix_leaves_the_square_of_the_correction():
    run = Run()
    run.solve(0.0, [1e-4, 5e-9], new=True)
    _, over_size, _ = run.solve(H, [2e-4], new=True)
    assert over_size == pytest.approx(contraction.SAFE_NEW * 0.5)
    assert run.known[contraction.MADE] == H


def test_a_new_matrix_is_trusted_with_no_larger_correction_than_seen():
    """A chain that moves slowly tells nothing of what large corrections leave."""
    run = Run()
    run.solve(0.0, [1e-6, 1e-12], new=True)
    assert _expected(True, 1.4e-6, run.expected(H)) < 1e-4
    assert _expected(True, 1e-5, run.expected(H)) == 1.0


def test_a_correction_beyond_the_way_of_a_step_is_a_leap():
    history, control = np.zeros(25), SimpleNamespace(allowed=1e-3, kinks=None)
    history[:3] = 1e-2, 0.3, 1e-7
    assert contraction.leaps(history, H, RATE, control)
    assert not contraction.leaps(history, H, 40.0, control)
    assert not contraction.leaps(0.1 * history, H, RATE, control)


def test_what_is_not_shown_for_long_is_expected_to_be_worse():
    run = Run()
    run.solve(0.0, [1e-4, 1e-9], new=True)
    run.solve(H, [1e-4, 1e-7])
    first = run.expected(H)[0]
    for _ in range(20):
        run.solve(H, [1e-6])
    assert run.expected(H)[0] > 2.0 * first
