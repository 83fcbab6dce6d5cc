"""A scene as ANC-TMM sees it: nodes in a row, a link from each to the next, and what is known beforehand.

Bodies stand in the order and direction in which the chain passes through them. Both sides of a joint have a node
of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.mesh import body_meshes, constant_forces
from anctmm.errors import BranchError, ClosedLoopError, DiscretisationError, EndJoinedTwiceError
from anctmm.model.joints import Joint
from anctmm.model.scene import Clamp, Scene, Weld
from anctmm.model.topology import End, end_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: What leads from a body's last node to the next node of the row.
PIN, WELD, BREAK = 1, 2, 3
#: Turn of a weld below which its two frames count as one, rad.
ALIGNED = 1e-12


class Link(NamedTuple):
    """A body of a chain, passed from its inboard to its outboard end, with the joints at both.

    A joint between two bodies is the `outboard` one of the first and the `inboard` one of the next.
    """

    body: str
    reversed: bool
    inboard: Joint | None
    outboard: Joint | None


def chains_of(scene: Scene) -> list[list[Link]]:
    """Chains from ground or free end to ground or free end, in the order of their first bodies.

    Raises
    ------
    BranchError
        If more than two ends meet.
    EndJoinedTwiceError
        If an end is in two joints.
    ClosedLoopError
        If bodies are left that no end of a chain leads to.
    """
    at: dict[End, tuple[Joint, End | None]] = {}
    for joint in scene.joints:
        ends = [end_of(scene, name) for name in joint.ends]
        if len(ends) > 2:
            raise BranchError(
                f"{joint!r} joins {len(ends)} ends; solver 'anctmm' allows two so far, 'global-dae' any number"
            )
        for i, end in enumerate(ends):
            if end in at:
                raise EndJoinedTwiceError(
                    f"end {joint.ends[i]!r} is in {at[end][0]!r} and in {joint!r}; solver 'anctmm' allows one joint "
                    f"an end so far, 'global-dae' several"
                )
            at[end] = (joint, ends[1 - i] if len(ends) == 2 else None)
    free: tuple[Joint | None, End | None] = (None, None)
    chains: list[list[Link]] = []
    seen: set[str] = set()
    for body in scene.bodies:
        for side in (0, 1):
            if body.name not in seen and at.get((body.name, side), free)[1] is None:
                chain = _walk((body.name, side), at, free)
                seen.update(link.body for link in chain)
                chains.append(chain)
    left = [body.name for body in scene.bodies if body.name not in seen]
    if left:
        raise ClosedLoopError(
            f"bodies {', '.join(map(repr, left))} close a loop that does not pass through the ground; solver 'anctmm' "
            f"needs chains from ground or free end to ground or free end so far, 'global-dae' does not"
        )
    return chains


def _walk(
    first: End, at: Mapping[End, tuple[Joint | None, End | None]], free: tuple[Joint | None, End | None]
) -> list[Link]:
    chain: list[Link] = []
    entry: End | None = first
    while entry is not None:
        body, side = entry
        inboard = at.get(entry, free)[0]
        outboard, entry = at.get((body, 1 - side), free)
        chain.append(Link(body, side == 1, inboard, outboard))
    return chain


@dataclass(frozen=True)
class Chain:
    """Chains of a scene laid one after another, a BREAK between them.

    Parameters
    ----------
    scene : Scene
    run : Discretisation

    Raises
    ------
    MeshError
        If the discretisation does not fit the scene's bodies.
    DiscretisationError
        If a weld joins a shear element to another kind.
    """

    scene: Scene
    run: Discretisation

    def __post_init__(self) -> None:
        kinds = self.run.of(self.scene)
        for joint in self.scene.joints:
            if isinstance(joint, Weld):
                names = [self.scene.body_end(end)[0].name for end in joint.ends]
                if len({kinds[n][1] == "shear" for n in names}) > 1:
                    raise DiscretisationError(
                        f"{joint!r} joins elements {', '.join(f'{kinds[n][1]!r} of {n!r}' for n in names)}; "
                        f"a weld needs one kind on both sides, or 'cable' and 'rigid' (a pin does not)"
                    )

    @cached_property
    def _links(self):  # type: ignore[no-untyped-def]
        return [link for chain in chains_of(self.scene) for link in chain]

    @cached_property
    def bodies(self) -> Bodies:
        """Bodies in the order and direction of the chain."""
        return Bodies(body_meshes(self.scene, self.run, [(k.body, k.reversed) for k in self._links]))

    @cached_property
    def link(self) -> Ints:
        """PIN, WELD or BREAK behind the last node of each body."""
        return np.array(
            [
                BREAK
                if k.outboard is None or len(k.outboard.ends) == 1
                else WELD
                if isinstance(k.outboard, Weld)
                else PIN
                for k in self._links
            ],
            dtype=np.int64,
        )

    @cached_property
    def turn(self) -> Array:
        """Cosine and sine of the turn from each body's frame to the next one's, (bodies, 2)."""
        meshes = self.bodies.meshes
        table = np.tile([1.0, 0.0], (len(meshes), 1))
        for b in map(int, np.flatnonzero(self.link == WELD)):
            a, c = meshes[b].reference[0, 1], meshes[b + 1].reference[0, 1]
            table[b] = a @ c, a[0] * c[1] - a[1] * c[0]
            if table[b, 0] > 0.0 and abs(table[b, 1]) < ALIGNED:
                table[b] = 1.0, 0.0
        return table

    @property
    def split(self) -> bool:
        """Whether x and y, and r_y and the rest, do not mix in the mass: no weld at an angle."""
        return bool((self.turn[:, 1] == 0.0).all() and (self.turn[:, 0] > 0.0).all())

    @cached_property
    def prescribed(self) -> NDArray[np.bool_]:
        """Components whose motion is known, (rows, nodes); so are those that a cable has not."""
        bodies = self.bodies
        mask = np.zeros((bodies.rows, bodies.nodes), dtype=bool)
        for i, mesh in enumerate(bodies.meshes):
            mask[2 * mesh.vectors :, bodies.first[i] : bodies.first[i + 1]] = True
        for joint in self.scene.joints:
            for end in joint.ends if joint.grounded else ():
                held = None if isinstance(joint, Clamp) else 2
                mask[:held, bodies.node(*_name_and_side(self.scene, end))] = True
        return mask

    @cached_property
    def hubs(self) -> list[tuple[int, Clamp]]:
        """Nodes whose clamp turns."""
        return [
            (self.bodies.node(*_name_and_side(self.scene, j.end)), j)
            for j in self.scene.joints
            if isinstance(j, Clamp) and j.angle is not None
        ]

    @cached_property
    def dead_load(self) -> Array:
        """Gravity and constant forces, (rows, nodes), N."""
        f = self.bodies.weight()
        for name, side, force in constant_forces(self.scene):
            f[:2, self.bodies.node(name, side)] += force
        return f

    def initial_velocity(self) -> Array:
        """Velocities at t = 0 that the joints allow, (rows, nodes).

        Bodies' velocities are made to fit with the least change: what is held rests, welded gradients share the mean.
        """
        bodies = self.bodies
        v = bodies.initial_velocity()
        for b in np.flatnonzero(self.link == WELD):
            i = int(bodies.first[b + 1]) - 1
            turn = complex(*self.turn[b])
            for k in range(0, bodies.rows, 2):
                factor = 1.0 if k == 0 else turn
                one, two = complex(*v[k : k + 2, i]), complex(*v[k : k + 2, i + 1])
                mean = 0.5 * (one + two * np.conj(factor))
                v[k : k + 2, i] = mean.real, mean.imag
                v[k : k + 2, i + 1] = (mean * factor).real, (mean * factor).imag
        v[self.prescribed] = 0.0
        return v

    @property
    def length(self) -> float:
        """Length of all bodies, m: the scale of positions."""
        return sum(body.length for body in self.scene.bodies)

    @property
    def dofs(self) -> int:
        """Coordinates of all nodes, known ones included."""
        return sum(2 * m.vectors * m.nodes for m in self.bodies.meshes)


def _name_and_side(scene: Scene, end: str) -> tuple[str, int]:
    body, side = scene.body_end(end)
    return body.name, side


class Joined:
    """Independent unknowns of a chain: those of all nodes, less known ones, less the outboard doubles at joints.

    Parameters
    ----------
    chain : Chain
    """

    def __init__(self, chain: Chain) -> None:
        bodies = chain.bodies
        self.shape = (bodies.rows, bodies.nodes)
        index = np.arange(bodies.rows * bodies.nodes).reshape(self.shape)
        master = ~chain.prescribed
        entries = []
        for b in np.flatnonzero(chain.link != BREAK):
            i = int(bodies.first[b + 1]) - 1
            c, s = chain.turn[b]
            for k in range(0, 2 if chain.link[b] == PIN else bodies.rows, 2):
                if chain.prescribed[k, i]:
                    continue
                x, y = (1.0, 0.0) if k == 0 else (c, s)
                master[k : k + 2, i + 1] = False
                for row, column, value in ((0, 0, x), (0, 1, -y), (1, 0, y), (1, 1, x)):
                    entries.append((index[k + row, i + 1], index[k + column, i], value))
        self.masters = index[master]
        number = np.full(index.size, -1)
        number[self.masters] = np.arange(self.masters.size)
        rows = np.concatenate([self.masters, [e[0] for e in entries]]).astype(int)
        columns = number[np.concatenate([self.masters, [e[1] for e in entries]]).astype(int)]
        values = np.concatenate([np.ones(self.masters.size), [e[2] for e in entries]])
        self.matrix = csr_array((values, (rows, columns)), shape=(index.size, self.masters.size))

    @property
    def size(self) -> int:
        """Number of independent unknowns."""
        return int(self.masters.size)

    def spread(self, x: Array) -> Array:
        """Unknowns of all nodes, (rows, nodes), from the independent ones."""
        return (self.matrix @ x).reshape(self.shape)

    def gather(self, f: Array) -> Array:
        """Generalized forces on the independent unknowns from those on all nodes, (rows, nodes)."""
        return self.matrix.T @ f.ravel()

    def load(self, f: Array) -> Array:
        """Forces on nodes, (rows, nodes), whose `gather` is f."""
        out = np.zeros(self.shape)
        out.ravel()[self.masters] = f
        return out

    def unknowns(self, a: Array) -> Array:
        """Independent unknowns among those of all nodes, (rows, nodes)."""
        return a.ravel()[self.masters]
