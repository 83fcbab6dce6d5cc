"""Variants of the cantilever of the rules with features of mechanisms, and whether these do what they should."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import anctmm
from anctmm.model.drives import Quintic
from anctmm.model.joints import Joint
from anctmm.model.loads import Load
from anctmm.model.needs import features_of
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
from anctmm.results.solution import Solution
from reference import global_dae
from studies.conformance.subject import BrokenRule, Measure, Subject

Array = NDArray[np.float64]
#: From a scene to one that needs a feature, or to what it is compared with.
Change = Callable[[Scene], Scene]

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


def _with_plate(*joints: Joint) -> Change:
    """A rigid body at the end of the bar, held by joints."""
    return lambda scene: replace(scene, bodies=(*scene.bodies, _plate()), joints=(*scene.joints, *joints))


def _joined(*joints: Joint) -> Change:
    return lambda scene: replace(scene, joints=(*scene.joints, *joints))


def _connected(*connectors: Connector) -> Change:
    return lambda scene: replace(scene, connectors=(*scene.connectors, *connectors))


def _loaded(*loads: Load) -> Change:
    return lambda scene: replace(scene, loads=(*scene.loads, *loads))


def _weighted(scene: Scene) -> Scene:
    mass = PointMass("tip", 1.0, FAR)
    return replace(scene, bodies=(*scene.bodies, mass), joints=(*scene.joints, Pin("bar.end", "tip.center")))


def damped(scene: Scene) -> Scene:
    """Of a damped material: stresses grow with the rate of strain."""
    bodies = (replace(b, material=replace(b.material, damping=1e-2)) for b in scene.beams)
    return replace(scene, bodies=tuple(bodies))


#: By feature.
DEMANDS: Mapping[str, Change] = {
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
#: What a feature is compared with, where that is not the cantilever alone: the same without what makes it one.
WITHOUT: Mapping[str, Change] = {
    "driven-guides": DEMANDS["sliders"],
    "driven-welds": _with_plate(Weld("bar.end", "plate.a")),
    "driven-springs": _connected(Spring("bar.end", (1.0, -0.5), stiffness=20.0)),
    "follower-forces": _loaded(Force("bar.end", (0.0, -1.0))),
}
#: Features whose effect is seen. Whether a stretch is held means nothing to elements without one.
CHANGES = {name: DEMANDS[name] for name in DEMANDS.keys() - {"free-stretch", "free-welds"}} | {
    "damping": damped
}
#: Part by which what a feature does may differ from what it does in another solver, on the same mesh.
ALLOWED = 0.2
PROBES = ("bar.end", ("bar", 0.5))


def acts(subject: Subject, other: Subject, feature: str, scene: Scene) -> float | None:
    """How far what a feature does to a scene differs from what it does in another solver, over the latter.

    Parameters
    ----------
    subject, other : Subject
    feature : str
        Of `CHANGES`.
    scene : Scene
        Without it.

    Returns
    -------
    float or None
        None where the solver lacks it, or lacks it with each of its integrators.
    """
    changed, plain = CHANGES[feature](scene), WITHOUT.get(feature, lambda same: same)(scene)
    needed = {feature, *features_of(changed)}
    integrators = (i for i in subject.offer.integrators if not subject.offer.lacking({*needed, i}))
    integrator = next(integrators, None)
    if integrator is None:
        return None
    theirs = _effect(*(subject.motion(s, integrator=integrator) for s in (changed, plain)))
    ours = _effect(*(other.motion(s, element="cable") for s in (changed, plain)))
    return float(np.abs(theirs - ours).max() / np.abs(ours).max())


def _effect(changed: Solution, plain: Solution) -> Array:
    """Difference of two motions at the probes."""
    return np.array([changed.displacement(p) - plain.displacement(p) for p in PROBES])


def features_act(subject: Subject, scene: Scene) -> Measure | str:
    """Each feature that it claims does what it does in another solver.

    Raises
    ------
    BrokenRule
        Naming those that do not.
    """
    ours = subject.name == "anctmm"
    other = Subject("global-dae", global_dae.solve) if ours else Subject("anctmm", anctmm.solve)
    found = {name: acts(subject, other, name, scene) for name in sorted(CHANGES)}
    known = {name: off for name, off in found.items() if off is not None}
    wrong = [f"{name} ({off:.2g})" for name, off in known.items() if not off <= ALLOWED]
    if wrong:
        raise BrokenRule(
            f"what these do differs by so many times it from another solver: {', '.join(wrong)}; {ALLOWED:g} is allowed"
        )
    if not known:
        return "lacks all of them"
    worst = max(known, key=lambda name: known[name])
    return Measure(known[worst], ALLOWED, f"of what {worst} do, the worst of {len(known)}")
