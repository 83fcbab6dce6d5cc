"""The scenes of the rules: one soft bar of 1 m, and changes of it that need a feature."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import cos, pi, sin
from typing import Any

import anctmm as at
from anctmm.elements.kinds import KINDS
from anctmm.model.scene import Point, Scene

#: From a scene to one that needs a feature, or to the scene with which that is compared.
Change = Callable[[Scene], Scene]

SECTION, MATERIAL, LENGTH = at.Rectangle(0.05, 0.05), at.Material(E=1e7, density=1000.0), 1.0
EI, MASS = MATERIAL.E * SECTION.second_moment, MATERIAL.density * SECTION.area * LENGTH
GRAVITY = 9.81
#: End of the bar.
FAR: Point = (LENGTH, 0.0)
UP: Point = (0.0, 1.0)
DOWN: Point = (0.0, -1.0)


def bar(name: str = "bar", start: Point = (0.0, 0.0), angle: float = 0.0) -> at.Beam:
    """The bar, somewhere."""
    end = (start[0] + LENGTH * cos(angle), start[1] + LENGTH * sin(angle))
    return at.Beam(name, start, end, SECTION, MATERIAL)


def cantilever(
    gravity: float = GRAVITY, angle: float = 0.0, start: Point = (0.0, 0.0), **parts: Any
) -> Scene:
    """Clamped, and let go in gravity; all of it turned and moved; with other loads or joints."""
    down = (gravity * sin(angle), -gravity * cos(angle))
    parts = {"joints": (at.Clamp("bar.start"),), **parts}
    return Scene("cantilever", (bar(start=start, angle=angle),), gravity=down, **parts)


def more(**parts: Any) -> Change:
    """With more bodies, joints, loads or connectors."""

    def change(scene: Scene) -> Scene:
        added: dict[str, Any] = {k: (*getattr(scene, k), *more) for k, more in parts.items()}
        return replace(scene, **added)

    return change


def with_plate(*joints: Any) -> Change:
    """With a rigid body at the end of the bar."""
    points = {"a": FAR, "b": (1.4, 0.0)}
    return more(bodies=[at.RigidBody("plate", 1.0, 0.01, (1.2, 0.1), points)], joints=joints)


def spring(ground: Point = (1.0, -1.0), **options: Any) -> Change:
    """With a spring from the end of the bar to the ground."""
    return more(connectors=[at.Spring("bar.end", ground, **options)])


def same(scene: Scene) -> Scene:
    """Nothing is changed."""
    return scene


def clamped(**options: Any) -> Change:
    """With other options of its clamp, the first joint."""
    return lambda scene: replace(scene, joints=(at.Clamp("bar.start", **options), *scene.joints[1:]))


def damped(scene: Scene) -> Scene:
    """Of a damped material: stresses grow with the rate of strain."""
    bodies = (replace(b, material=replace(b.material, damping=1e-2)) for b in scene.beams)
    return replace(scene, bodies=tuple(bodies))


def _triangle() -> Change:
    """With a triangle beside it that hangs from a corner."""
    first, last = (bar(n, (0.0, -LENGTH), a) for n, a in (("first", -pi / 3.0), ("last", -2.0 * pi / 3.0)))
    base = at.Beam("base", last.end, first.end, SECTION, MATERIAL)
    hinge = at.Pin("first.start", "last.start", grounded=True)
    joints = hinge, at.Pin("first.end", "base.end"), at.Weld("last.end", "base.start")
    return more(bodies=(first, last, base), joints=joints)


FORK = [at.Weld("bar.end", "left.start"), at.Pin("left.start", "right.start")]
SLIDING = more(joints=[at.Slider("bar.end", UP)])
#: By a feature of mechanisms.
MECHANISMS: Mapping[str, Change] = {
    "rigid-bodies": with_plate(at.Pin("bar.end", "plate.a")),
    "point-masses": more(bodies=[at.PointMass("tip", 1.0, FAR)], joints=[at.Pin("bar.end", "tip.center")]),
    "sliders": SLIDING,
    "prismatic-joints": more(joints=[at.Prismatic("bar.end", UP)]),
    "driven-guides": more(joints=[at.Slider("bar.end", UP, position=at.Quintic(0.01, 1.0))]),
    "moving-guides": with_plate(at.Slider("bar.end", body="plate"), at.Pin("plate.b")),
    "driven-welds": with_plate(at.Weld("bar.end", "plate.a", angle=at.Quintic(0.1, 1.0))),
    "interior-joints": more(joints=[at.Pin(("bar", 0.5))]),
    "springs": spring(stiffness=20.0),
    "rotational-springs": more(connectors=[at.RotationalSpring("bar.end", stiffness=1.0)]),
    "driven-springs": spring((1.0, -0.5), stiffness=20.0, length=lambda t: (0.5 + 0.1 * t, 0.1)),
    "laws": spring(law=lambda elongation, rate, t: 40.0 * elongation + 10.0 * elongation**3),
    "interior-loads": more(loads=[at.Force(("bar", 0.3), DOWN)]),
    "follower-forces": more(loads=[at.Force("bar.end", DOWN, follower=True)]),
    "line-loads": more(loads=[at.LineLoad("bar", DOWN)]),
    "free-stretch": clamped(stretch="free"),
    "free-welds": with_plate(at.Weld("bar.end", "plate.a", stretch="free")),
}
#: Changes of the cantilever that make it need a feature. The order matters: clamps first.
DEMANDS: Mapping[str, Change] = {
    "drives": clamped(angle=at.Quintic(0.1, 1.0)),
    "joints": more(bodies=[bar("second", FAR)], joints=[at.Pin("bar.end", "second.start")]),
    "branches": more(bodies=[bar("left", FAR, 0.8), bar("right", FAR, -0.8)], joints=FORK),
    "loops": _triangle(),
    "varying-loads": more(loads=[at.Force("bar.end", lambda t: (0.0 * t, 5.0 * t))]),
    "damping": damped,
    **MECHANISMS,
    "statics": same,
}
#: By a feature, pairs of ends that are in one place.
MEETING: Mapping[str, list[tuple[tuple[str, float], tuple[str, float]]]] = {
    "joints": [(("bar", 1.0), ("second", 0.0))],
    "branches": [(("bar", 1.0), ("left", 0.0)), (("bar", 1.0), ("right", 0.0))],
    "loops": [
        (("first", 1.0), ("base", 1.0)), (("last", 1.0), ("base", 0.0)), (("first", 0.0), ("last", 0.0)),
    ],
}  # fmt: skip
#: Features with an effect on the bar. Whether a stretch is held means nothing to elements without one.
ACTING = [f for f in DEMANDS if f not in MEETING and f != "statics" and not f.startswith("free-")]
#: The scene with which a feature is compared, where that is not the bar alone.
WITHOUT: Mapping[str, Change] = {
    "driven-guides": SLIDING,
    "driven-welds": with_plate(at.Weld("bar.end", "plate.a")),
    "driven-springs": spring((1.0, -0.5), stiffness=20.0),
    "follower-forces": more(loads=[at.Force("bar.end", DOWN)]),
}
#: Options of a run that needs a feature.
RUNS: Mapping[str, dict[str, Any]] = {
    **{k.name: {"mesh": 1 if k.rigid else 8, "element": k.name} for k in KINDS.values() if k.optional},
    "zhai": {"integrator": "zhai"},
    "generalized-alpha": {"integrator": "generalized-alpha"},
    "esdirk": {"integrator": "esdirk", "dt": 1e-3},
}
