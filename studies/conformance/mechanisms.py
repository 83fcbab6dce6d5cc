"""Variants of a clamped bar with features of mechanisms, and whether a solver gives these features their effect."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import anctmm as at
from anctmm.model.joints import Joint
from anctmm.model.needs import features_of
from anctmm.model.scene import Connector, Load, Scene
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from studies.conformance.subject import BrokenRule, Subject

#: From a scene to one that needs a feature, or to the scene with which that is compared.
Change = Callable[[Scene], Scene]

#: End of the bar.
FAR = (1.0, 0.0)
#: Part by which the effect of a feature may differ from that in another solver, on the same mesh.
ALLOWED = 0.2
PROBES = ("bar.end", ("bar", 0.5))


def _law(elongation: float, rate: float, t: float) -> float:
    """Tension that grows faster than the elongation, N."""
    return 40.0 * elongation + 10.0 * elongation**3


def _length(t: float) -> tuple[float, float]:
    """Free length and its rate, m and m/s."""
    return 0.5 + 0.1 * t, 0.1


def _with_body(body: at.RigidBody | at.PointMass, *joints: Joint) -> Change:
    return lambda scene: replace(scene, bodies=(*scene.bodies, body), joints=(*scene.joints, *joints))


def _with_plate(*joints: Joint) -> Change:
    return _with_body(at.RigidBody("plate", 1.0, 0.01, (1.2, 0.1), {"a": FAR, "b": (1.4, 0.0)}), *joints)


def _joined(*joints: Joint) -> Change:
    return lambda scene: replace(scene, joints=(*scene.joints, *joints))


def _connected(*connectors: Connector) -> Change:
    return lambda scene: replace(scene, connectors=(*scene.connectors, *connectors))


def _loaded(*loads: Load) -> Change:
    return lambda scene: replace(scene, loads=(*scene.loads, *loads))


def damped(scene: Scene) -> Scene:
    """Of a damped material: stresses grow with the rate of strain."""
    bodies = (replace(b, material=replace(b.material, damping=1e-2)) for b in scene.beams)
    return replace(scene, bodies=tuple(bodies))


def freely_stretched(scene: Scene) -> Scene:
    """With clamps that leave the stretch free."""
    joints = (replace(j, stretch="free") if isinstance(j, at.Clamp) else j for j in scene.joints)
    return replace(scene, joints=tuple(joints))


#: By feature.
DEMANDS: Mapping[str, Change] = {
    "rigid-bodies": _with_plate(at.Pin("bar.end", "plate.a")),
    "point-masses": _with_body(at.PointMass("tip", 1.0, FAR), at.Pin("bar.end", "tip.center")),
    "sliders": _joined(at.Slider("bar.end", (0.0, 1.0))),
    "prismatic-joints": _joined(at.Prismatic("bar.end", (0.0, 1.0))),
    "driven-guides": _joined(at.Slider("bar.end", (0.0, 1.0), position=at.Quintic(0.01, 1.0))),
    "moving-guides": _with_plate(at.Slider("bar.end", body="plate"), at.Pin("plate.b")),
    "driven-welds": _with_plate(at.Weld("bar.end", "plate.a", angle=at.Quintic(0.1, 1.0))),
    "free-stretch": freely_stretched,
    "free-welds": _with_plate(at.Weld("bar.end", "plate.a", stretch="free")),
    "interior-joints": _joined(at.Pin(("bar", 0.5))),
    "springs": _connected(at.Spring("bar.end", (1.0, -1.0), stiffness=20.0)),
    "rotational-springs": _connected(at.RotationalSpring("bar.end", stiffness=1.0)),
    "driven-springs": _connected(at.Spring("bar.end", (1.0, -0.5), stiffness=20.0, length=_length)),
    "laws": _connected(at.Spring("bar.end", (1.0, -1.0), law=_law)),
    "interior-loads": _loaded(at.Force(("bar", 0.3), (0.0, -1.0))),
    "follower-forces": _loaded(at.Force("bar.end", (0.0, -1.0), follower=True)),
    "line-loads": _loaded(at.LineLoad("bar", (0.0, -1.0))),
}
#: The scene with which a feature is compared, where that is not the bar alone.
WITHOUT: Mapping[str, Change] = {
    "driven-guides": DEMANDS["sliders"],
    "driven-welds": _with_plate(at.Weld("bar.end", "plate.a")),
    "driven-springs": _connected(at.Spring("bar.end", (1.0, -0.5), stiffness=20.0)),
    "follower-forces": _loaded(at.Force("bar.end", (0.0, -1.0))),
}
#: Features with an effect. Whether a stretch is held means nothing to elements without one.
CHANGES = {name: DEMANDS[name] for name in DEMANDS.keys() - {"free-stretch", "free-welds"}} | {
    "damping": damped
}


def features_act(subject: Subject, scene: Scene) -> tuple[float, float, str] | str:
    """Compare the effect of each declared feature with that in another solver; BrokenRule names those that differ."""
    name = "global-dae" if subject.name == "anctmm" else "anctmm"
    other = Subject(name, registry.load(name))
    found = {feature: _difference(subject, other, feature, scene) for feature in sorted(CHANGES)}
    known = {feature: off for feature, off in found.items() if off is not None}
    wrong = [f"{feature} ({off:.2g})" for feature, off in known.items() if not off <= ALLOWED]
    if wrong:
        raise BrokenRule(
            f"effects differ by more than {ALLOWED:g} of them from those in another solver: {', '.join(wrong)}"
        )
    if not known:
        return "lacks all of them"
    worst = max(known, key=lambda feature: known[feature])
    return known[worst], ALLOWED, f"of the effect of {worst}, the worst of {len(known)}"


def _difference(subject: Subject, other: Subject, feature: str, scene: Scene) -> float | None:
    """Relative difference of the effect of a feature; None where it is lacking with each integrator."""
    changed, plain = CHANGES[feature](scene), WITHOUT.get(feature, lambda same: same)(scene)
    needed = {feature, *features_of(changed)}
    fitting = (i for i in subject.offer.integrators if not subject.offer.lacking({*needed, i}))
    integrator = next(fitting, None)
    if integrator is None:
        return None
    theirs = _effect(*(subject.motion(s, integrator=integrator) for s in (changed, plain)))
    ours = _effect(*(other.motion(s, element="cable") for s in (changed, plain)))
    return float(np.abs(theirs - ours).max() / np.abs(ours).max())


def _effect(changed: Solution, plain: Solution) -> NDArray[np.float64]:
    """Difference of two motions at the probes."""
    return np.array([changed.displacement(p) - plain.displacement(p) for p in PROBES])
