"""Strain energy, elastic and damping forces, and tangents of all flexible elements of a scene, by NumPy.

Equal elements are evaluated together, the arrays over elements (e), points of quadrature (p), coordinate vectors of an
element (i, j) and components (c, d). The strains are those of the readable elements of `anctmm.elements`, whose rules,
sections and masses are used; nothing else is shared with ANC-TMM.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.elements.cable import CableElement
from anctmm.elements.shear import STRAIN_FORMS, STRAIN_OFFSETS, ShearElement
from reference.global_dae.layout import Layout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Matrix = sparse.csc_array

#: a × b = a·(W b) in the plane.
W = np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True)
class Group:
    """Equal elements.

    Parameters
    ----------
    element : CableElement or ShearElement
    starts : ndarray of int, shape (elements,)
        Numbers of their first coordinates; the others follow.
    """

    element: Any
    starts: Ints

    @cached_property
    def at(self) -> Ints:
        """Numbers of their coordinates, (elements, coordinates)."""
        return self.starts[:, None] + np.arange(4 * self.element.vectors_per_node)

    def of(self, q: Array) -> Array:
        """Their coordinates, (…, elements, vectors, 2), from those of a scene, (…, size)."""
        return q[..., self.at].reshape(*q.shape[:-1], *self.at.shape[:1], -1, 2)

    def energy(self, q: Array) -> Array:
        """Strain energy, J, at coordinates (…, vectors, 2)."""
        return sum(  # type: ignore[return-value]
            0.5 * np.einsum("...pk,kl,...pl,p->...", s, D, s, w) for s, D, w in self.strains(q)
        )

    def strains(self, q: Array) -> Iterable[tuple[Array, Array, Array]]:
        """Strains at the points of each rule, stiffness and weights."""
        raise NotImplementedError

    def forces(self, q: Array) -> Array:
        """Elastic forces, (e, i, c)."""
        raise NotImplementedError

    def damping(self, q: Array, v: Array) -> Array:
        """Damping forces, which work against v, (e, i, c)."""
        raise NotImplementedError

    def tangents(self, q: Array, factor: float) -> Array:
        """Derivatives of the elastic forces, (e, i, c, j, d); the part of the material times a factor."""
        raise NotImplementedError


class ThinGroup(Group):
    """Cables, cubic or quintic: ε = |r'| − 1 and κ = r' × r''/|r'|²."""

    def strains(self, q: Array) -> Iterable[tuple[Array, Array, Array]]:
        """ε, then κ."""
        e, (B, w), (A, C, u) = self.element, self.element.axial_rule, self.element.bending_rule
        yield (np.linalg.norm(B @ q, axis=-1) - 1.0)[..., None], np.array([[e.EA]]), w
        b, c = A @ q, C @ q
        yield ((b * (c @ W.T)).sum(-1) / (b * b).sum(-1))[..., None], np.array([[e.EI]]), u

    def forces(self, q: Array) -> Array:
        """Elastic forces, (e, i, c)."""
        t, stretch = self._axial(q)
        kappa, by_b, by_c = self._bending(q)[:3]
        return self._resultant(self.element.EA * (stretch - 1.0), t, self.element.EI * kappa, by_b, by_c)

    def damping(self, q: Array, v: Array) -> Array:
        """Damping forces, which work against v, (e, i, c)."""
        e, (B, _), (A, C, _) = self.element, self.element.axial_rule, self.element.bending_rule
        t, _stretch = self._axial(q)
        _, by_b, by_c = self._bending(q)[:3]
        axial = (t * (B @ v)).sum(-1)
        bending = (by_b * (A @ v)).sum(-1) + (by_c * (C @ v)).sum(-1)
        return self._resultant(e.damping * e.EA * axial, t, e.damping * e.EI * bending, by_b, by_c)

    def tangents(self, q: Array, factor: float) -> Array:
        """Derivatives of the elastic forces, (e, i, c, j, d); the part of the material times a factor."""
        e, (B, w), (A, C, u) = self.element, self.element.axial_rule, self.element.bending_rule
        t, stretch = self._axial(q)
        tt = t[..., :, None] * t[..., None, :]
        slope = (1.0 - 1.0 / stretch)[..., None, None]
        H = e.EA * w[:, None, None] * (factor * tt + slope * (np.eye(2) - tt))
        K = _summed(H, B, B)

        kappa, by_b, by_c, b, s = self._bending(q)
        n = A.shape[1] * 2
        gradient = A[:, :, None] * by_b[..., None, :] + C[:, :, None] * by_c[..., None, :]
        gradient = gradient.reshape(*by_b.shape[:2], n)
        weighted = (factor * e.EI * u)[:, None] * gradient
        K += (gradient.transpose(0, 2, 1) @ weighted).reshape(-1, n // 2, 2, n // 2, 2)
        # second derivatives of κ = (b·W c)/s, s = b·b
        bb = -2.0 * (b[..., :, None] * by_b[..., None, :] + by_b[..., :, None] * b[..., None, :])
        bb = (bb - 2.0 * kappa[..., None, None] * np.eye(2)) / s[..., None, None]
        bc = (W - 2.0 * b[..., :, None] * by_c[..., None, :]) / s[..., None, None]
        moment = (e.EI * u * kappa)[..., None, None]
        cross = _summed(moment * bc, A, C)
        K += _summed(moment * bb, A, A)
        return np.asarray(K + cross + cross.transpose(0, 3, 4, 1, 2))

    def _axial(self, q: Array) -> tuple[Array, Array]:
        """Unit tangent and stretch at the points of the axial rule."""
        b = self.element.axial_rule[0] @ q
        stretch = np.linalg.norm(b, axis=-1)
        return b / stretch[..., None], stretch

    def _bending(self, q: Array) -> tuple[Array, Array, Array, Array, Array]:
        """κ, its derivatives by r' and r'', r' and |r'|² at the points of the bending rule."""
        A, C, _ = self.element.bending_rule
        b, c = A @ q, C @ q
        s = (b * b).sum(-1)
        kappa = (b * (c @ W.T)).sum(-1) / s
        by_b = (c @ W.T - 2.0 * kappa[..., None] * b) / s[..., None]
        return kappa, by_b, (b @ W) / s[..., None], b, s

    def _resultant(self, N: Array, t: Array, M: Array, by_b: Array, by_c: Array) -> Array:
        """Generalized forces of axial forces N and bending moments M at the points."""
        (B, w), (A, C, u) = self.element.axial_rule, self.element.bending_rule
        force, moment = (w * N)[..., None] * t, (u * M)[..., None]
        return np.asarray(B.T @ force + A.T @ (moment * by_b) + C.T @ (moment * by_c))


def _summed(H: Array, A: Array, C: Array) -> Array:
    """Σ_p A_pi H_epcd C_pj, (e, i, c, j, d)."""
    found = np.tensordot(H, A[:, :, None] * C[:, None, :], axes=(1, 0))
    return found.transpose(0, 3, 1, 4, 2)


class ShearGroup(Group):
    """Shear-deformable elements: strains s_k = ½ X·Q_k X + const of X = [c', d', d]."""

    def strains(self, q: Array) -> Iterable[tuple[Array, Array, Array]]:
        """The six strains."""
        B, w = self.element.operators
        X = B @ q[..., None, :, :]
        s = 0.5 * _strains(X, X) + STRAIN_OFFSETS
        yield s, self.element.stiffness, w

    def forces(self, q: Array) -> Array:
        """Elastic forces, (e, i, c)."""
        ((s, D, _),) = self.strains(q)
        return self._resultant(q, s @ D)

    def damping(self, q: Array, v: Array) -> Array:
        """Damping forces, which work against v, (e, i, c)."""
        B, _ = self.element.operators
        X, rates = B @ q[..., None, :, :], B @ v[..., None, :, :]
        return self._resultant(q, self.element.damping * _strains(X, rates) @ self.element.stiffness)

    def tangents(self, q: Array, factor: float) -> Array:
        """Derivatives of the elastic forces, (e, i, c, j, d); the part of the material times a factor."""
        B, w = self.element.operators
        ((s, D, _),) = self.strains(q)
        QB = np.tensordot(STRAIN_FORMS, B, axes=(2, 1))  # (k, a, p, i)
        E = np.einsum("kapi,epac->epkic", QB, B @ q[..., None, :, :])  # ∂s_k/∂q
        n = 2 * B.shape[2]
        E = E.reshape(len(q), -1, n)
        weighted = (np.kron(np.diag(factor * w), D) @ E).reshape(E.shape)
        K = (E.transpose(0, 2, 1) @ weighted).reshape(-1, n // 2, 2, n // 2, 2)
        forms = np.einsum("p,pai,kapj->pkij", w, B, QB)
        stress = np.tensordot(s @ D, forms, axes=2)
        return np.asarray(K + stress[:, :, None, :, None] * np.eye(2)[:, None, :])

    def _resultant(self, q: Array, stress: Array) -> Array:
        """Generalized forces of stresses (e, p, k)."""
        B, w = self.element.operators
        N = np.tensordot(stress * w[:, None], STRAIN_FORMS, axes=1)  # (e, p, a, b)
        Y = N @ (B @ q[..., None, :, :])
        return np.tensordot(Y, B, axes=([1, 2], [0, 1])).transpose(0, 2, 1)


def _strains(X: Array, Y: Array) -> Array:
    """X·Q_k Y of all strains, (…, p, 6)."""
    products = X @ np.swapaxes(Y, -1, -2)  # (…, p, a, b)
    return np.tensordot(products, STRAIN_FORMS, axes=([-2, -1], [1, 2]))


#: Groups by the kind of strains.
GROUPS: tuple[tuple[type, type[Group]], ...] = ((CableElement, ThinGroup), (ShearElement, ShearGroup))


class Beams:
    """All flexible beams of a layout."""

    def __init__(self, layout: Layout) -> None:
        self.size = layout.size
        starts: dict[Any, list[Ints]] = {}
        for mesh in layout.meshes.values():
            starts.setdefault(mesh.element, []).append(mesh.starts)
        self.groups = [
            next(group for kind, group in GROUPS if isinstance(element, kind))(element, np.concatenate(found))
            for element, found in starts.items()
        ]
        self.damped = any(group.element.damping for group in self.groups)

    def mass(self) -> Matrix:
        """Mass matrix, (size, size), of the beams alone."""
        return self._matrix(
            np.broadcast_to(np.kron(g.element.mass, np.eye(2)), (len(g.starts), *g.at.shape[1:] * 2))
            for g in self.groups
        )

    def weight(self, gravity: tuple[float, float]) -> Array:
        """Forces of gravity, (size,)."""
        return self._vector(
            np.broadcast_to(
                np.multiply.outer(g.element.gravity, gravity), (len(g.starts), *g.at[:1].reshape(-1, 2).shape)
            )
            for g in self.groups
        )

    def force(self, q: Array) -> Array:
        """Elastic forces, the gradient of the strain energy."""
        return self._vector(g.forces(g.of(q)) for g in self.groups)

    def damping(self, q: Array, v: Array) -> Array:
        """Damping forces of the materials, which act on the bodies: they work against v."""
        if not self.damped:
            return np.zeros(self.size)
        return -self._vector(g.damping(g.of(q), g.of(v)) for g in self.groups)

    def tangent(self, q: Array, by_velocity: float = 0.0) -> Matrix:
        """Derivative of the elastic forces, and `by_velocity` (1/s) times that of damping by its material part."""
        return self._matrix(
            g.tangents(g.of(q), 1.0 + by_velocity * g.element.damping).reshape(*g.at.shape, -1)
            for g in self.groups
        )

    def energy(self, q: Array) -> Array:
        """Strain energy, J, (…,), at coordinates (…, size)."""
        return sum((g.energy(g.of(q)).sum(-1) for g in self.groups), np.zeros(q.shape[:-1]))

    def _vector(self, parts: Iterable[Array]) -> Array:
        total = np.zeros(self.size)
        for group, part in zip(self.groups, parts, strict=True):
            total += np.bincount(group.at.ravel(), part.ravel(), self.size)
        return total

    def _matrix(self, parts: Iterable[Array]) -> Matrix:
        values = [np.zeros(0), *(part.ravel() for part in parts)]
        return Matrix((np.concatenate(values), self._pattern), shape=(self.size, self.size))

    @cached_property
    def _pattern(self) -> tuple[Ints, Ints]:
        """Rows and columns of the entries of the elements' matrices."""
        none = np.zeros(0, dtype=np.int64)
        rows = [np.repeat(g.at, g.at.shape[1], axis=1).ravel() for g in self.groups]
        columns = [np.tile(g.at, (1, g.at.shape[1])).ravel() for g in self.groups]
        return np.concatenate([none, *rows]), np.concatenate([none, *columns])
