"""Checks of a history in space: gradients, elements turned inside out, places that joints hold."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from anctmm.model.joints import built_in
from anctmm.results.checks.finding import Finding, part
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Gradient of a beam, and distance of joined places over the length of the scene, above which a run is refused.
STRETCHED, PARTED = 1e3, 1e-4
#: Advice of all messages.
ADVICE = "a smaller dt or smaller loads may help"


def spatial_shapes(solution: Solution) -> Iterator[Finding]:
    """The first output at which a gradient is too large, or an element is turned inside out."""
    for name, field in solution.fields.items():
        if isinstance(field, HermiteField):
            yield from _of_shape(name, field)


def _of_shape(name: str, field: HermiteField) -> Iterator[Finding]:
    """The first output at which a gradient is too large, or an element runs against both of its gradients."""
    q = field.coordinates
    chord = q[:, 1:, 0] - q[:, :-1, 0]
    against = [(chord * q[:, end, 1]).sum(axis=2) < 0.0 for end in (slice(None, -1), slice(1, None))]
    wild = ~(np.abs(q[:, :, 1]).max(axis=2) <= STRETCHED)
    for bad, what in (
        (wild[:, :-1] | wild[:, 1:], f"gradients grew beyond {STRETCHED:g} in {{where}}"),
        (against[0] & against[1], "{where} is turned inside out"),
    ):
        if bad.any():
            k = int(bad.any(axis=1).argmax())
            element = int(bad[k].argmax())
            where = what.replace("{where}", part(name, element))
            yield Finding(k, "diverged", f"{where} at {{when}}; {ADVICE}", name, element)


def parted_places(solution: Solution) -> Iterator[Finding]:
    """The first output at which joined places are apart."""
    scene = solution.scene
    for joint in built_in(scene.joints) if solution.t.size else ():
        places = [scene.place(end) for end in joint.ends]
        first, *others = (solution.fields[place.body.name].position(place.key) for place in places)
        if joint.grounded:
            others.append(np.asarray(places[0].position))
        for other in others:
            apart = np.linalg.norm(first - other, axis=1)
            bad = ~(apart <= PARTED * scene.length)
            if bad.any():
                k = int(bad.argmax())
                yield Finding(
                    k, "failed", f"places of {joint!r} are {apart[k]:.2g} m apart at {{when}}; {ADVICE}"
                )
