"""Topologies that a walk through a graph may get wrong: bodies side by side, K4, loops that meet at one place, …"""

from math import cos, sin

from graphs import MATERIAL, SECTION

import anctmm as at

O, X, Y, D = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)  # noqa: E741
C, FAR = (0.3, 0.3), [(cos(i), sin(i)) for i in range(6)]
SPOKES = [(f"s{i}", O, FAR[i]) for i in range(6)]
SQUARE = [("a", O, X), ("b", X, D), ("c", D, Y), ("d", Y, O)]
LAYOUTS = {
    "two bodies side by side": [("a", O, X), ("b", X, O)],
    "three bodies side by side": [("a", O, X), ("b", X, O), ("c", O, X)],
    "square": SQUARE,
    "square with a tail": [*SQUARE, ("t", X, (2.0, 0.0)), ("u", (2.0, 0.0), (2.0, 1.0))],
    "K4": [("a", O, X), ("b", X, Y), ("c", Y, O), ("d", O, C), ("e", X, C), ("f", C, Y)],
    "two loops that share a place": [
        *[("a", O, X), ("b", X, Y), ("c", Y, O)],
        *[("d", O, (-1.0, 0.0)), ("e", (-1.0, 0.0), (0.0, -1.0)), ("f", (0.0, -1.0), O)],
    ],
    "two loops and a bridge": [
        *[*SQUARE, ("t", X, (2.0, 0.0)), ("u", (2.0, 0.0), (3.0, 0.0))],
        *[("v", (3.0, 0.0), (2.0, 1.0)), ("w", (2.0, 1.0), (2.0, 0.0))],
    ],
    "two loops and a tree apart": [
        *[
            *SQUARE,
            ("t", (5.0, 0.0), (6.0, 0.0)),
            ("u", (6.0, 0.0), (5.0, 1.0)),
            ("v", (5.0, 1.0), (5.0, 0.0)),
        ],
        *[("w", (8.0, 0.0), (8.0, 1.0)), ("x", (8.0, 1.0), (9.0, 1.0)), ("y", (8.0, 1.0), (9.0, 2.0))],
    ],
    "three bodies apart": [("a", O, X), ("b", Y, D), ("c", (0.0, 2.0), (1.0, 2.0))],
}


def meeting(layout):
    """Ends that meet at each place."""
    ends = {}
    for name, start, end in layout:
        ends.setdefault(start, []).append(f"{name}.start")
        ends.setdefault(end, []).append(f"{name}.end")
    return [e for e in ends.values() if len(e) > 1]


def built(layout, *joints):
    """A scene of a layout, with a force and a torque."""
    bodies = [at.Beam(name, start, end, SECTION, MATERIAL) for name, start, end in layout]
    loads = [at.Torque(f"{layout[0][0]}.end", 0.1), at.Force(f"{layout[-1][0]}.start", (1.0, 0.5))]
    return at.Scene("odd", bodies, joints, loads, gravity=(0.0, -2.0))


def held(layout, kind):
    """A layout joined everywhere in one way, and held in every way."""
    ends = meeting(layout)
    joints = [kind(*e) for e in ends]
    yield "free", built(layout, *joints)
    yield "clamped", built(layout, *joints, at.Clamp("a.start"))
    yield "driven", built(layout, *joints, at.Clamp("a.end", at.Quintic(0.3, 0.05)))
    if ends:
        yield "one grounded", built(layout, *joints[1:], kind(*ends[0], grounded=True))
        yield "all grounded", built(layout, *[kind(*e, grounded=True) for e in ends])
        yield "all clamped", built(layout, *joints, *[at.Clamp(e[0]) for e in ends])


def three_pairs(layout, kind):
    """Six spokes, welded in pairs that are hinged to each other; the rest of a layout joined in one way."""
    pairs = [at.Weld(f"s{i}.start", f"s{i + 1}.start") for i in (0, 2, 4)]
    others = [kind(*e) for e in meeting(layout) if len(e) < 6]
    return built(layout, *pairs, at.Pin("s0.start", "s2.start", "s4.start"), *others)


RIM = [(f"o{i}", FAR[i], FAR[i + 1]) for i in range(5)]
TWO = LAYOUTS["two loops that share a place"]
ODD = {
    f"{name}, {kind.__name__.lower()}, {how}": scene
    for name, layout in LAYOUTS.items()
    for kind in (at.Pin, at.Weld)
    for how, scene in held(layout, kind)
} | {
    "three welded pairs": three_pairs(SPOKES, at.Pin),
    "three welded pairs and a hinged rim": three_pairs([*SPOKES, *RIM], at.Pin),
    "three welded pairs and a welded rim": three_pairs([*SPOKES, *RIM], at.Weld),
    "two loops with a clamped group between them": built(
        TWO,
        *[at.Pin(*e) for e in meeting(TWO) if len(e) == 2],
        at.Weld("a.start", "d.start"),
        at.Pin("a.start", "c.end", "f.end"),
        at.Clamp("a.start"),
    ),
}
