"""The cable in space: its forces, tangents and energy beside the readable element, and that beside complex steps."""

import numpy as np
import pytest

from anctmm.elements.cable import RULES, CableElement
from anctmm.elements.compiled import address
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.spatial_cable_kernel import constants
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.kernels.intrinsics import call, call_number
from anctmm.kernels.options import kernel

rng = np.random.default_rng(3)


def nodes(count):
    """Coordinates of a lively axis, (6, count)."""
    t = np.arange(count)[:, None]
    r = 0.4 * t * [1.0, 0.2, -0.3] + 0.1 * rng.normal(size=(count, 3))
    slope = np.array([0.8, 0.3, -0.5]) + 0.4 * rng.normal(size=(count, 3))
    return np.hstack([r, slope]).T.copy()


@kernel
def call_forces(place, q, count, numbers, out):
    """Call a kernel of forces at its address."""
    call(place, q, 0, count, numbers, out)


@kernel
def call_tangents(place, q, count, numbers, out):
    """Call a kernel of tangents at its address."""
    call(place, q, 0, count, numbers, 1.0, 1.0, out)


@kernel
def call_energy(place, q, count, numbers):
    """Call an energy at its address."""
    return call_number(place, q, 0, count, numbers)


def of_element(q, i):
    """Coordinates of element i, (4, 3)."""
    return q[:, i : i + 2].T.reshape(4, 3)


@pytest.mark.parametrize("rule", RULES)
def test_kernels_give_what_the_readable_element_gives(rule):
    e, q = CableElement(0.4, 3e4, 20.0, 1.3, rule), nodes(6)
    out, tangents = np.zeros(12 * BLOCK), np.zeros(TANGENT_BUFFER)
    call_forces(address("spatial_cable", "forces"), q, 5, constants(e), out)
    call_tangents(address("spatial_cable", "tangents"), q, 5, constants(e), tangents)
    total = 0.0
    for i in range(5):
        x = of_element(q, i)
        force = out.reshape(12, BLOCK)[:, i].reshape(4, 3)
        assert np.abs(force - e.force(x)).max() < 1e-11 * np.abs(force).max()
        K = e.tangent(x).reshape(12, 12)
        lower = [K[k, m] for k in range(12) for m in range(k + 1)]
        assert np.abs(tangents.reshape(-1, TANGENT_BLOCK)[:78, i] - lower).max() < 1e-11 * np.abs(K).max()
        total += e.energy(x)
    energy = call_energy(address("spatial_cable", "energy"), q, q.shape[1] - 1, constants(e))
    assert energy == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_forces_and_tangents_are_derivatives(dim):
    e, q = CableElement(0.4, 3e4, 20.0, 1.3), of_element(nodes(2), 0)[:, :dim]
    step = 1e-30
    for k, c in np.ndindex(4, dim):
        moved = q.astype(complex)
        moved[k, c] += 1j * step
        assert np.imag(e.energy(moved)) / step == pytest.approx(e.force(q)[k, c], rel=1e-10, abs=1e-8)
        by_step = np.imag(e.force(moved)) / step
        assert np.abs(by_step - e.tangent(q)[:, :, k, c]).max() < 1e-10 * np.abs(e.tangent(q)).max()


def test_rotations_leave_the_energy():
    e, q = CableElement(0.4, 3e4, 20.0, 1.3), of_element(nodes(2), 0)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert e.energy(q @ R.T) == pytest.approx(e.energy(q), rel=1e-12)
    assert np.abs(e.force(q @ R.T) - e.force(q) @ R.T).max() < 1e-11 * np.abs(e.force(q)).max()
