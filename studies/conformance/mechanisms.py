"""Variants of the cantilever of the rules with features of mechanisms: bodies, guides, connectors and loads."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from anctmm.model.drives import Quintic
from anctmm.model.joints import Joint
from anctmm.model.loads import Load
from anctmm.model.scene import (
    Clamp,
    Connector,
    Force,
    LineLoad,
    Pin,
    PointMass,
    Prismatic,
    RigidBody,
    RotationalSpring,
    Scene,
    Slider,
    Spring,
    Weld,
)

FAR = (1.0, 0.0)
"""End of the bar."""


def _law(elongation: float, rate: float, t: float) -> float:
    """Tension that grows faster than the elongation, N."""
    return 40.0 * elongation + 10.0 * elongation**3


def _length(t: float) -> tuple[float, float]:
    """Free length and its rate, m and m/s."""
    return 0.5 + 0.1 * t, 0.1


def _plate(name: str = "plate") -> RigidBody:
    return RigidBody(name, 1.0, 0.01, (1.2, 0.1), {"a": FAR, "b": (1.4, 0.0)})


def _with_plate(*joints: Joint) -> Callable[[Scene], Scene]:
    """A rigid body at the end of the bar, held by joints."""
    return lambda scene: replace(scene, bodies=(*scene.bodies, _plate()), joints=(*scene.joints, *joints))


def _joined(*joints: Joint) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, joints=(*scene.joints, *joints))


def _connected(*connectors: Connector) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, connectors=(*scene.connectors, *connectors))


def _loaded(*loads: Load) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, loads=(*scene.loads, *loads))


def _weighted(scene: Scene) -> Scene:
    mass = PointMass("tip", 1.0, FAR)
    return replace(scene, bodies=(*scene.bodies, mass), joints=(*scene.joints, Pin("bar.end", "tip.center")))


#: By feature.
DEMANDS: Mapping[str, Callable[[Scene], Scene]] = {
    "rigid-bodies": _with_plate(Pin("bar.end", "plate.a")),
    "point-masses": _weighted,
    "sliders": _joined(Slider("bar.end", (0.0, 1.0))),
    "prismatic-joints": _joined(Prismatic("bar.end", (0.0, 1.0))),
    "driven-guides": _joined(Slider("bar.end", (0.0, 1.0), position=Quintic(0.01, 1.0))),
    "moving-guides": _with_plate(Slider("bar.end", body="plate"), Pin("plate.b")),
    "driven-welds": _with_plate(Weld("bar.end", "plate.a", angle=Quintic(0.1, 1.0))),
    "free-stretch": lambda scene: replace(
        scene, joints=tuple(replace(j, stretch="free") if isinstance(j, Clamp) else j for j in scene.joints)
    ),
    "free-welds": _with_plate(Weld("bar.end", "plate.a", stretch="free")),
    "interior-joints": _joined(Pin(("bar", 0.5))),
    "springs": _connected(Spring("bar.end", (1.0, -1.0), stiffness=20.0)),
    "rotational-springs": _connected(RotationalSpring("bar.end", stiffness=1.0)),
    "driven-springs": _connected(Spring("bar.end", (1.0, -0.5), stiffness=20.0, length=_length)),
    "laws": _connected(Spring("bar.end", (1.0, -1.0), law=_law)),
    "interior-loads": _loaded(Force(("bar", 0.3), (0.0, -1.0))),
    "follower-forces": _loaded(Force("bar.end", (0.0, -1.0), follower=True)),
    "line-loads": _loaded(LineLoad("bar", (0.0, -1.0))),
}
