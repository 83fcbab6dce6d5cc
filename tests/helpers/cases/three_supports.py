"""A beam on three supports; a load passes over it, from node to node."""

from math import cos, pi

import anctmm as at

WOOD = at.Material(E=1e9, density=600.0)
SPEED, SPAN = 20.0, 1.0
parts = [
    at.Beam(f"part{k}", (k * SPAN, 0.0), ((k + 1) * SPAN, 0.0), at.Rectangle(0.05, 0.04), WOOD)
    for k in range(4)
]
joints = [
    at.Pin("part0.start"),
    at.Weld("part0.end", "part1.start"),
    at.Weld("part1.end", "part2.start", grounded=True),
    at.Weld("part2.end", "part3.start"),
    at.Pin("part3.end"),
]


def passing(place):
    """The share of a moving load that a node at a place carries."""

    def force(t):
        away = abs(SPEED * t - place)
        return 0.0, -40.0 * (0.5 + 0.5 * cos(pi * away / SPAN)) if away < SPAN else 0.0

    return at.History(force, breaks=[(place - SPAN) / SPEED, (place + SPAN) / SPEED])


loads = [at.Force("part0.end", passing(1.0)), at.Force("part2.end", passing(3.0))]
scene = at.Scene("three-supports", parts, joints, loads)
CASES = [at.Case(scene, ["part0.end", "part2.end"], t_end=0.2, output_dt=0.01, note="It comes at 20 m/s.")]
