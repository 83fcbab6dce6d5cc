"""Joints that do not fit each other or their bodies are refused, and the message names what and what is allowed."""

import pytest
from samples import B as X1
from samples import beam, refused

from anctmm.errors import (
    ContradictingJointsError,
    EndJoinedTwiceError,
    JointGapError,
    RepeatedJointError,
    SceneError,
    UnknownNameError,
)
from anctmm.model.drives import Quintic
from anctmm.model.joints import Prismatic, Slider
from anctmm.model.scene import Clamp, Pin, Scene, Weld

O = (0.0, 0.0)  # noqa: E741
DRIVE, OTHER = Quintic(1.0, 1.0), Quintic(-1.0, 1.0)
A, B, C, D, E, F = (f"{name}.start" for name in "abcdef")
TIPS = {"a": X1, "b": (0.0, 1.0), "c": (-1.0, 0.0), "d": (0.0, -1.0), "e": (1.0, 1.0), "f": (-1.0, 1.0)}


def star(*joints, moved=(), rows=(), far=0.0):
    """Six bodies that start at one place.

    Those in `moved` start `far` from it along x; those in `rows` (name, velocity at the start) move.
    """
    speeds = dict(rows)
    bodies = [
        beam(
            name,
            (far if name in moved else 0.0, 0.0),
            tip,
            velocity=(lambda s, v=speeds[name]: ((1.0 - s) * v, 0.0)) if name in speeds else None,
        )
        for name, tip in TIPS.items()
    ]
    return Scene("star", bodies, joints)


def ring(*joints, gap=0.0):
    """Three bodies in a row that come back to where they began, but for a gap."""
    corners = [O, (1.0, 0.0), (0.5, 0.8), (gap, 0.0)]
    return Scene("ring", [beam(n, corners[i], corners[i + 1]) for i, n in enumerate("abc")], joints)


REPEATS = {
    "a pin and a weld": (Pin(A, B), Weld(A, B)),
    "three pins": (Pin(A, B), Pin(B, C), Pin(C, A)),
    "a pin of three over a weld": (Weld(A, B), Pin(A, B, C)),
    "held twice by pins": (Pin(A), Pin(A)),
    "a clamp and a pin": (Clamp(A), Pin(A)),
    "a driven clamp and a pin": (Clamp(A, DRIVE), Pin(A)),
    "a clamp and a pin behind a hinge": (Clamp(A), Pin(A, B), Pin(B)),
    "two clamps at one end": (Clamp(A), Clamp(A)),
    "a pin of two clamped ends": (Clamp(A), Clamp(B), Pin(A, B)),
    "three lines": (Slider(A), Slider(A, (0, 1)), Slider(A, (1, 1))),
    "two directions on welded ends": (Prismatic(A), Weld(A, B), Prismatic(B, (0, 1))),
}
CONTRADICTIONS = {
    "driven and fixed at one end": (Clamp(A), Clamp(A, DRIVE)),
    "driven and fixed on welded ends": (Clamp(A, DRIVE), Weld(A, B), Clamp(B)),
    "driven in two ways": (Clamp(A, DRIVE), Clamp(B, OTHER), Weld(B, A)),
    "driven along a line across another": (Slider(A, position=DRIVE), Slider(A, (0, 1))),
}
ENDS = {
    "an end twice in a pin": (lambda: (Pin(A, A),), EndJoinedTwiceError, ["'a.start'", "2 times", "once"]),
    "a pin of nothing": (lambda: (Pin(),), SceneError, ["Pin(", "0 end(s)", "1 or more"]),
    "a weld of nothing": (lambda: (Weld(),), SceneError, ["Weld(", "0 end(s)", "2 or more"]),
    "an unknown third end": (
        lambda: (Pin(A, B, "c.middle"),),
        UnknownNameError,
        ["'c.middle'", "'c.start', 'c.end' and fractions"],
    ),
    "a third end that is no text": (lambda: (Pin(A, B, 3),), UnknownNameError, ["3", "name.start"]),
}
GAPS = {
    "the third end of a pin lies apart": (
        lambda: star(Pin(A, B, C), moved="c", far=0.1),
        ["Pin(", "'a.start'", "(0.1, 0.0) ('c.start')", "0.1 m apart", "allowed"],
    ),
    "a loop that does not close": (
        lambda: ring(Pin("a.end", "b.start"), Pin("b.end", "c.start"), Pin("c.end", "a.start"), gap=0.01),
        ["Pin(ends=('c.end', 'a.start')", "0.01 m apart", "allowed"],
    ),
    "both ends of one body": (lambda: star(Pin(A, "a.end")), ["'a.start'", "'a.end'", "1 m apart"]),
    "a third end that moves": (
        lambda: star(Pin(A, B, C), rows=[("c", 2.0)]),
        ["Pin(", "'a.start'", "'c.start' moves at (2, 0) m/s", "off by 2"],
    ),
    "a held hinge that moves": (
        lambda: star(Pin(A, B, C, grounded=True), rows=[("a", 1.0), ("b", 1.0), ("c", 1.0)]),
        ["'a.start' moves at (1, 0) m/s", "grounded=True"],
    ),
}
CASES = {
    **{
        n: (lambda j=j: star(*j), RepeatedJointError, ["already", type(j[-1]).__name__])
        for n, j in REPEATS.items()
    },
    **{n: (lambda j=j: star(*j), ContradictingJointsError, ["Quintic"]) for n, j in CONTRADICTIONS.items()},
    **{n: (lambda j=j: star(*j()), error, w) for n, (j, error, w) in ENDS.items()},
    **{n: (build, JointGapError, w) for n, (build, w) in GAPS.items()},
}


@pytest.mark.parametrize("name", CASES)
def test_joints_that_do_not_fit_are_refused_by_name(name):
    build, error, words = CASES[name]
    with refused(error, words, exactly=True):
        build()


RIGHT = {
    "two welded, a third hinged": (Weld(A, B), Pin(B, C)),
    "a star of pins": (Pin(A, B), Pin(A, C), Pin(A, D)),
    "a clamp that others hang on": (Clamp(A, DRIVE), Pin(A, B, C), Weld(C, D)),
    "clamps side by side": (Clamp(A), Clamp(B, DRIVE), Pin(B, C)),
    "a hinge held by another joint": (Pin(A, B), Pin(B)),
    "two lines that cross": (Slider(A), Slider(A, (1, 1))),
}


@pytest.mark.parametrize("name", RIGHT)
def test_joints_that_fit_are_accepted(name):
    assert star(*RIGHT[name]).joints == RIGHT[name]
