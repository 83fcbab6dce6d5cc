"""Scenes of many beams between places: a chain in a zigzag, a binary tree, a ladder."""

from collections.abc import Callable, Sequence
from math import cos, pi, sin
from typing import Any

from anctmm.model.bodies import Beam, Material
from anctmm.model.joints import Joint
from anctmm.model.scene import Scene
from anctmm.model.sections import Section

Place = tuple[float, float]

#: Directions of a zigzag's beams, to either side of the x axis, rad.
ZIGZAG = pi / 6


class Graph:
    """Beams of one kind between places, and the ends that meet at each place.

    Parameters
    ----------
    section : Section
    material : Material
    """

    def __init__(self, section: Section, material: Material) -> None:
        self.section, self.material = section, material
        self.bodies: list[Beam] = []
        self.ends: dict[Place, list[str]] = {}

    def beam(self, name: str, start: Place, end: Place) -> "Graph":
        """Add a beam."""
        self.bodies.append(Beam(name, start, end, self.section, self.material))
        for (x, y), side in ((start, "start"), (end, "end")):
            self.ends.setdefault((round(x, 9), round(y, 9)), []).append(f"{name}.{side}")
        return self

    def scene(
        self,
        name: str,
        joint: Callable[..., Joint],
        *others: Joint,
        loads: Sequence[Any] = (),
        gravity: Place = (0.0, 0.0),
    ) -> Scene:
        """The scene whose beams are joined wherever their ends meet; `others` are joints beside these."""
        joints = [joint(*ends) for ends in self.ends.values() if len(ends) > 1]
        return Scene(name, self.bodies, [*joints, *others], loads, gravity)


def add_zigzag(graph: Graph, beams: int, length: float = 1.0) -> Graph:
    """Beams "z0", "z1", … in a row, by turns to either side of the x axis."""
    dx, dy = length * cos(ZIGZAG), length * sin(ZIGZAG)
    places = [(k * dx, (k % 2) * dy) for k in range(beams + 1)]
    for k in range(beams):
        graph.beam(f"z{k}", places[k], places[k + 1])
    return graph


def add_tree(graph: Graph, beams: int, length: float = 1.0, angle: float = 0.6) -> Graph:
    """Beams "t0_0", "t1_0", "t1_1", … that part in two at each level, the last of which need not be full.

    From level to level the angle (rad) between a beam and those that grow from it becomes less.
    """
    ends, level, left = [((0.0, 0.0), 0.5 * pi)], 0, beams
    while left > 0:
        grown: list[tuple[Place, float]] = []
        for n, (place, way) in enumerate(ends[:left]):
            tip = (place[0] + length * cos(way), place[1] + length * sin(way))
            graph.beam(f"t{level}_{n}", place, tip)
            grown += [(tip, way + angle / (level + 1)), (tip, way - angle / (level + 1))]
        ends, level, left = grown, level + 1, left - len(ends)
    return graph


def add_ladder(graph: Graph, rungs: int, length: float = 1.0) -> Graph:
    """Two rails along the x axis, "d0", … and "u0", …, and so many rungs "r0", … between them: squares."""
    for i in range(rungs):
        x, there = length * i, length * (i + 1)
        graph.beam(f"r{i}", (x, 0.0), (x, length))
        if i < rungs - 1:
            graph.beam(f"d{i}", (x, 0.0), (there, 0.0)).beam(f"u{i}", (x, length), (there, length))
    return graph
