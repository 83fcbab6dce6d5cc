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
#: Angle of the driven clamp, rad, reached in 2 s; growth of the pull, N/s.
TURN, PULL = 0.1, 50.0


def bar(name: str = "bar", start: Point = (0.0, 0.0), angle: float = 0.0) -> at.Beam:
    """The bar, somewhere."""
    end = (start[0] + LENGTH * cos(angle), start[1] + LENGTH * sin(angle))
    return at.Beam(name, start, end, SECTION, MATERIAL)


def cantilever(gravity: float = GRAVITY, angle: float = 0.0, start: Point = (0.0, 0.0)) -> Scene:
    """Clamped, and let go in gravity; all of it turned and moved."""
    down = (gravity * sin(angle), -gravity * cos(angle))
    return Scene("cantilever", (bar(start=start, angle=angle),), (at.Clamp("bar.start"),), gravity=down)


def falling() -> Scene:
    """Without joints."""
    return Scene("free bar", (bar(),), gravity=(0.0, -GRAVITY))


def pulled() -> Scene:
    """Free, pulled along its axis by a force that grows with time."""
    return Scene("free bar", (bar(),), loads=(at.Force("bar.end", lambda t: (PULL * t, 0.0 * t)),))


def loaded() -> Scene:
    """The static scene: P L²/(E I) = 2 down, and an end moment the other way."""
    loads = (at.Force("bar.end", (0.0, -2.0 * EI / LENGTH**2)), at.Torque("bar.end", 0.3 * EI / LENGTH))
    return Scene("loaded cantilever", (bar(),), (at.Clamp("bar.start"),), loads)


# --- changes ---------------------------------------------------------------------------------------------------


def more(**parts: Any) -> Change:
    """With more bodies, joints, loads or connectors."""

    def change(scene: Scene) -> Scene:
        added: dict[str, Any] = {k: (*getattr(scene, k), *more) for k, more in parts.items()}
        return replace(scene, **added)

    return change


def joined(*joints: Any) -> Change:
    """With more joints."""
    return more(joints=joints)


def with_plate(*joints: Any) -> Change:
    """With a rigid body at the end of the bar."""
    points = {"a": FAR, "b": (1.4, 0.0)}
    return more(bodies=[at.RigidBody("plate", 1.0, 0.01, (1.2, 0.1), points)], joints=joints)


def spring(ground: Point = (1.0, -1.0), **options: Any) -> Change:
    """With a spring from the end of the bar to the ground."""
    return more(connectors=[at.Spring("bar.end", ground, **options)])


def loaded_by(*loads: Any) -> Change:
    """With more loads."""
    return more(loads=loads)


def same(scene: Scene) -> Scene:
    """Nothing is changed."""
    return scene


def turning(scene: Scene) -> Scene:
    """With the clamp driven, so slowly that the bar hardly bends."""
    drive = at.Clamp("bar.start", angle=at.Quintic(turn=TURN, duration=2.0))
    return replace(scene, joints=(drive, *scene.joints[1:]))


def damped(scene: Scene) -> Scene:
    """Of a damped material: stresses grow with the rate of strain."""
    bodies = (replace(b, material=replace(b.material, damping=1e-2)) for b in scene.beams)
    return replace(scene, bodies=tuple(bodies))


def freely_stretched(scene: Scene) -> Scene:
    """With clamps that leave the stretch free."""
    joints = (replace(j, stretch="free") if isinstance(j, at.Clamp) else j for j in scene.joints)
    return replace(scene, joints=tuple(joints))


def _triangle() -> Change:
    """With a triangle beside it that hangs from a corner."""
    first, last = (bar(n, (0.0, -LENGTH), a) for n, a in (("first", -pi / 3.0), ("last", -2.0 * pi / 3.0)))
    base = at.Beam("base", last.end, first.end, SECTION, MATERIAL)
    hinge = at.Pin("first.start", "last.start", grounded=True)
    joints = hinge, at.Pin("first.end", "base.end"), at.Weld("last.end", "base.start")
    return more(bodies=(first, last, base), joints=joints)


def _law(elongation: float, rate: float, t: float) -> float:
    """Tension that grows faster than the elongation, N."""
    return 40.0 * elongation + 10.0 * elongation**3


def _length(t: float) -> tuple[float, float]:
    """Free length and its rate, m and m/s."""
    return 0.5 + 0.1 * t, 0.1


UP: Point = (0.0, 1.0)
DOWN: Point = (0.0, -1.0)
LENGTHENED = more(bodies=[bar("second", FAR)], joints=[at.Pin("bar.end", "second.start")])
FORK = [at.Weld("bar.end", "left.start"), at.Pin("left.start", "right.start")]
BRANCHED = more(bodies=[bar("left", FAR, 0.8), bar("right", FAR, -0.8)], joints=FORK)
LOOPED = _triangle()
#: By a feature of mechanisms.
MECHANISMS: Mapping[str, Change] = {
    "rigid-bodies": with_plate(at.Pin("bar.end", "plate.a")),
    "point-masses": more(bodies=[at.PointMass("tip", 1.0, FAR)], joints=[at.Pin("bar.end", "tip.center")]),
    "sliders": joined(at.Slider("bar.end", UP)),
    "prismatic-joints": joined(at.Prismatic("bar.end", UP)),
    "driven-guides": joined(at.Slider("bar.end", UP, position=at.Quintic(0.01, 1.0))),
    "moving-guides": with_plate(at.Slider("bar.end", body="plate"), at.Pin("plate.b")),
    "driven-welds": with_plate(at.Weld("bar.end", "plate.a", angle=at.Quintic(0.1, 1.0))),
    "interior-joints": joined(at.Pin(("bar", 0.5))),
    "springs": spring(stiffness=20.0),
    "rotational-springs": more(connectors=[at.RotationalSpring("bar.end", stiffness=1.0)]),
    "driven-springs": spring((1.0, -0.5), stiffness=20.0, length=_length),
    "laws": spring(law=_law),
    "interior-loads": loaded_by(at.Force(("bar", 0.3), DOWN)),
    "follower-forces": loaded_by(at.Force("bar.end", DOWN, follower=True)),
    "line-loads": loaded_by(at.LineLoad("bar", DOWN)),
    "free-stretch": freely_stretched,
    "free-welds": with_plate(at.Weld("bar.end", "plate.a", stretch="free")),
}
#: Features with an effect. Whether a stretch is held means nothing to elements without one.
ACTING = {k: v for k, v in MECHANISMS.items() if not k.startswith("free-")} | {"damping": damped}
#: The scene with which a feature is compared, where that is not the bar alone.
WITHOUT: Mapping[str, Change] = {
    "driven-guides": MECHANISMS["sliders"],
    "driven-welds": with_plate(at.Weld("bar.end", "plate.a")),
    "driven-springs": spring((1.0, -0.5), stiffness=20.0),
    "follower-forces": loaded_by(at.Force("bar.end", DOWN)),
}
#: Changes of the cantilever that make it need a feature. The order matters: clamps first.
DEMANDS: Mapping[str, Change] = {
    "drives": turning,
    "joints": LENGTHENED,
    "branches": BRANCHED,
    "loops": LOOPED,
    "varying-loads": more(loads=pulled().loads),
    "damping": damped,
    **MECHANISMS,
    "statics": same,
}
#: Options of a run that needs a feature.
RUNS: Mapping[str, dict[str, Any]] = {
    **{k.name: {"mesh": 1 if k.rigid else 8, "element": k.name} for k in KINDS.values() if k.optional},
    "zhai": {"integrator": "zhai"},
    "generalized-alpha": {"integrator": "generalized-alpha"},
    "esdirk": {"integrator": "esdirk", "dt": 1e-3},
}
