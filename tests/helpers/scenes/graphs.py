"""Scenes that branch and close loops: a Y, a floating polygon, a grid, a ladder, a wheel, a binary tree."""

from math import cos, pi, sin

import anctmm as at
from studies.benchmark.branched import Graph, add_ladder, add_tree

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e8, density=1000.0, poisson=0.2)


def y_frame(joint):
    """Three beams that meet, one of them clamped."""
    g, c = Graph(SECTION, MATERIAL), (0.5, 0.1)
    g.beam("a", (0.0, 0.0), c).beam("b", c, (1.0, 0.6)).beam("c", (1.0, -0.5), c)
    return g.scene("y", joint, at.Clamp("a.start"), gravity=(0.0, -9.81))


def polygon(joint, sides=4):
    """A closed loop floating free, pushed at a corner."""
    places = [(cos(2 * pi * i / sides), sin(2 * pi * i / sides)) for i in range(sides)]
    g = Graph(SECTION, MATERIAL)
    for i in range(sides):
        g.beam(f"b{i}", places[i], places[(i + 1) % sides])
    return g.scene("polygon", joint, loads=[at.Force("b0.start", (1.0, 0.5))])


def grid(joint, fields=2):
    """A grid of square fields, floating free."""
    g = Graph(SECTION, MATERIAL)
    for i in range(fields + 1):
        for j in range(fields + 1):
            if i < fields:
                g.beam(f"h{i}_{j}", (1.0 * i, 1.0 * j), (i + 1.0, 1.0 * j))
            if j < fields:
                g.beam(f"v{i}_{j}", (1.0 * i, 1.0 * j), (1.0 * i, j + 1.0))
    return g.scene("grid", joint, loads=[at.Force("h0_0.start", (1.0, 0.5))])


def ladder(joint, rungs=4):
    """Two rails and rungs between them, floating free."""
    g = add_ladder(Graph(SECTION, MATERIAL), rungs)
    return g.scene("ladder", joint, loads=[at.Force("r0.start", (1.0, 0.5))])


def wheel():
    """Six spokes, in part welded to each other and in part hinged, and a rim whose corners are half welded."""
    rim = [(cos(pi * i / 3), sin(pi * i / 3)) for i in range(6)]
    inner = [f"s{i}.start" if i % 2 else f"s{i}.end" for i in range(6)]
    outer = [f"s{i}.end" if i % 2 else f"s{i}.start" for i in range(6)]
    g = Graph(SECTION, MATERIAL)
    for i in range(6):
        g.beam(f"s{i}", *((0.0, 0.0), rim[i])[:: 1 if i % 2 else -1]).beam(f"o{i}", rim[i], rim[(i + 1) % 6])
    joints = [
        at.Weld(inner[0], inner[3]),
        at.Weld(inner[1], inner[2], inner[4]),
        at.Pin(inner[0], inner[1], inner[5]),
    ]
    for i in range(6):
        joints += [at.Weld(outer[i], f"o{i}.start"), at.Pin(outer[i], f"o{i - 1 if i else 5}.end")]
    return at.Scene("wheel", g.bodies, joints, [at.Force("o2.end", (1.0, 0.0))])


def binary_tree(joint, levels=4):
    """Beams that part in two at each level."""
    g = add_tree(Graph(SECTION, MATERIAL), 2**levels - 1)
    return g.scene("tree", joint, at.Clamp("t0_0.start"), gravity=(0.0, -9.81))


SCENES = {
    f"{scene.__name__}-{joint.__name__.lower()}": scene(joint)
    for scene in (y_frame, polygon, grid, ladder, binary_tree)
    for joint in (at.Pin, at.Weld)
} | {"wheel": wheel()}
