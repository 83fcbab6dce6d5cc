"""Scenes that branch and close loops: a floating polygon, a binary tree."""

from functools import partial
from math import cos, pi, sin

import anctmm as at
from studies.benchmark.scenes import joined, tree_of

beam = partial(
    at.Beam, section=at.Rectangle(0.02, 0.01), material=at.Material(E=1e8, density=1000.0, poisson=0.2)
)


def polygon(joint, sides=4):
    """A closed loop floating free, pushed at a corner."""
    places = [(cos(2 * pi * i / sides), sin(2 * pi * i / sides)) for i in range(sides)]
    bodies = [beam(f"b{i}", places[i], places[(i + 1) % sides]) for i in range(sides)]
    return at.Scene("polygon", bodies, joined(bodies, joint), [at.Force("b0.start", (1.0, 0.5))])


def binary_tree(joint, levels=4):
    """Beams that part in two at each level."""
    bodies = tree_of(2**levels - 1, beam)
    return at.Scene("tree", bodies, [*joined(bodies, joint), at.Clamp("t0_0.start")], gravity=(0.0, -9.81))
