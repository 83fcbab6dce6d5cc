"""All equations of a scene as tables for kernels: from the mesh over the numbering to elements, rows, loads, matrix."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import shown
from anctmm.model.connectors import Connector, free_name, free_of, name_of
from anctmm.model.drives import tabulate
from anctmm.model.expressions import Signal
from anctmm.model.joints import Equation
from anctmm.model.loads import load_text, varies, width_of
from anctmm.model.scene import Scene
from anctmm.system.acting import Writer, dead_forces
from anctmm.system.body_meshes import RigidMesh, SpatialMesh
from anctmm.system.calls import calls_of
from anctmm.system.elastic import elements_of, vector_masses
from anctmm.system.mesh import GroundPlace, JointPlace, Mesh
from anctmm.system.numbering import Numbering
from anctmm.system.rows import rows_of
from anctmm.system.tables import Driven, Inputs, Matrix, Tables

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class System:
    """The equations of a scene.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    """

    def __init__(self, scene: Scene, run: Discretisation) -> None:
        self.scene, self.run = scene, run
        self.mesh = Mesh(scene, run)
        self.loads = [load for load in scene.loads if varies(load)]
        self._writer = Writer(self.mesh, self.loads, scene.connectors)
        self.numbering = Numbering(self.mesh, self._equations(), self._writer.coupled)
        self.signals = self._signals()

    def _equations(self) -> list[tuple[str, Sequence[Equation]]]:
        """What joints and rigid bodies say, each with what it holds in words."""
        mesh, found = self.mesh, list[tuple[str, Sequence[Equation]]]()
        for joint in self.scene.joints:
            places = [
                GroundPlace(mesh, end)
                if not isinstance(end, str) and not isinstance(end[0], str)
                else JointPlace(mesh, self.scene.place(end))
                for end in joint.attached
            ]
            found.append((shown(joint), joint.equations(*places)))
        for name, body in mesh.bodies.items():
            if isinstance(body, RigidMesh | SpatialMesh):
                axes = [mesh.expression(name, form) for form in body.frame()]
                found.append((f"the shape of rigid body {name!r}", body.shape(axes)))
        return found

    def _signals(self) -> list[Signal]:
        """All signals, in the order in which they are met."""
        found: dict[Signal, None] = {}
        for known in self.numbering.shares.known.values():
            found |= dict.fromkeys(w for w in known if w is not None)
        for row in self.numbering.rows:
            e = row.equation
            used = [*(w for _, _, w in e.pairs), *(w for _, w in e.terms), *e.constants]
            found |= dict.fromkeys(w for w in used if w is not None)
        return list(found)

    def inputs(self, t: Array) -> Inputs:
        """What histories give at times t, (n,).

        Raises
        ------
        PropertyError
            If one of them raises, or gives something else than finite numbers.
        """
        count, dim = len(t), self.mesh.dim
        signals = np.zeros((count, 1 + len(self.signals), 3))
        signals[:, 0, 0] = 1.0
        tables: dict[int, Array] = {}
        for n, w in enumerate(self.signals):
            if id(w.history) not in tables:
                tables[id(w.history)] = tabulate(w.name, w.history, t, 3).T
            signals[:, n + 1] = w.at(tables[id(w.history)]).T
        loads = np.zeros((count, len(self.loads), dim))
        for n, load in enumerate(self.loads):
            width = width_of(load, dim)
            if callable(load.value):
                loads[:, n, :width] = tabulate(load_text(load), load.value, t, width)
            else:
                loads[:, n, :width] = load.value
        free = np.zeros((count, len(self.scene.connectors), 2))
        for n, connector in enumerate(self.scene.connectors):
            free[:, n] = self._free(connector, n, t)
        return Inputs(t, signals, loads, free)

    def _free(self, connector: Connector, n: int, t: Array) -> Array:
        """Free measure of a connector and its rate at times t, (n, 2)."""
        free = connector.length if hasattr(connector, "length") else connector.angle  # type: ignore[union-attr]
        if callable(free):
            return tabulate(f"{name_of(connector)} {free_name(connector)}", free, t, 2)
        reference = float(self.tables.acting.placed[n])
        return np.tile(free_of(connector, reference, 0.0), (len(t), 1))

    @cached_property
    def tables(self) -> Tables:
        """Tables for kernels."""
        numbering, mesh = self.numbering, self.mesh
        elements = elements_of(numbering)
        rows = rows_of(numbering, self.signals, vector_masses(numbering))
        acting = self._writer.tables(numbering)
        plan, size = numbering.plan, mesh.rows
        values = np.zeros((numbering.blocks + len(plan.row), size, size))
        x = np.zeros((numbering.blocks, size))
        at = numbering.at
        matrix = Matrix(plan, values, values.reshape(-1), x, x.reshape(-1), at, numbering.padding)
        damped = (
            elements.damping.any() or acting.numbers[:, 1].any() or acting.law.any() or self._drives_lengths
        )
        parts: dict[str, Any] = {
            "elements": elements, "rows": rows, "acting": acting, "matrix": matrix, "driven": self._driven()
        }  # fmt: skip
        return Tables(
            **parts,
            dead=dead_forces(mesh, self.scene.loads),
            damped=np.array([bool(damped), elements.damping.any()], dtype=np.int64),
            calls=calls_of(self.size, self.space, parts),
        )

    @property
    def _drives_lengths(self) -> bool:
        return any(
            callable(c.length if hasattr(c, "length") else c.angle)  # type: ignore[union-attr]
            for c in self.scene.connectors
        )

    def _driven(self) -> Driven:
        """Vectors that change with drives."""
        mesh, shares = self.mesh, self.numbering.shares
        number: dict[Signal | None, int] = {None: 0, **{w: k + 1 for k, w in enumerate(self.signals)}}
        places, start, signals, b = list[int](), [0], list[int](), list[Array]()
        for x in sorted(shares.parent.keys() | shares.known.keys()):
            known = shares.value(x)
            if known is not None and set(known) - {None}:
                places.append(x)
                signals += [number[w] for w in known]
                b += list(known.values())
                start.append(len(signals))
        at = np.array(places, dtype=np.int64)
        return Driven(
            at // mesh.slots, at % mesh.slots * mesh.dim, np.array(start, dtype=np.int64),
            np.array(signals, dtype=np.int64), np.array(b, dtype=float).reshape(-1, mesh.dim),
            *self._elements_at({int(x) for x in at // mesh.slots}),
        )  # fmt: skip

    def _elements_at(self, nodes: set[int]) -> tuple[Ints, Ints]:
        """Beams and first nodes of the elements next to nodes."""
        found = list[tuple[int, int]]()
        for b, beam in enumerate(self.mesh.beams):
            first = self.mesh.first[beam.body.name]
            at = {n - 1 for n in nodes} | nodes
            found += [(b, node) for node in sorted(at) if first <= node < first + beam.elements]
        pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        return pairs[:, 0].copy(), pairs[:, 1].copy()

    def start(self) -> tuple[Array, Array]:
        """Coordinates and velocities at t = 0, (rows, nodes), as bodies state them, with vectors that are one equal."""
        mesh, shares, root = self.mesh, self.numbering.shares, self.numbering.root
        q, v = mesh.vectors_of(mesh.reference)[root], mesh.vectors_of(mesh.initial_velocity)[root]
        for x in shares.parent.keys() | shares.known.keys():
            known = shares.value(x)
            if known is not None:
                now = {w: np.zeros(3) if w is None else _at_zero(w) for w in known}
                q[x] = sum((1.0 if w is None else now[w][0]) * b for w, b in known.items())
                v[x] = sum(now[w][1] * b for w, b in known.items())
        return mesh.flat_of(q), mesh.flat_of(v)

    @cached_property
    def changing(self) -> bool:
        """Whether the Jacobian of the rows changes: with coordinates or in time."""
        rows = self.tables.rows
        return bool(len(rows.pairs) or rows.terms[:, 3].any())

    @property
    def space(self) -> tuple[int, ...]:
        """As many zeros as vectors have components: a constant for the compiler."""
        return (0,) * self.mesh.dim

    @property
    def size(self) -> tuple[int, ...]:
        """As many zeros as a block has rows."""
        return (0,) * self.mesh.rows


def _at_zero(w: Signal) -> Array:
    return w.at(tabulate(w.name, w.history, np.zeros(1), 3).T)[:, 0]
