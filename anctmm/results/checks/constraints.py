"""Joints and lengths that a history does not keep.

Solvers satisfy them by construction or to the tolerance of Newton's iteration; this check detects where one did not.
"""

from collections.abc import Iterator

import numpy as np

from anctmm.errors import shown
from anctmm.model.expressions import Linearised
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.scales import reach_of
from anctmm.results.fields import HermiteField
from anctmm.results.joint_rows import JointAtOutputs, rigid_bodies
from anctmm.results.solution import Solution
from anctmm.validation import EPS

#: Distance of joined places, of the length of all bodies, above which a joint is not kept; of angles, rad; a hundredth
#: of it is the strain of a rigid body. The global DAE without stabilisation drifts by 1e-12 in a million steps.
PARTED = 1e-4
ADVICE = "smaller steps or a smaller newton_tolerance may help"


def constraint_findings(solution: Solution) -> Iterator[Finding]:
    """The first output at which each joint, or the length of each rigid beam, is not kept."""
    scene = solution.scene
    if not len(solution.t) or solution.fields.keys() != {body.name for body in scene.bodies}:
        return
    rounding, rigid = 1e3 * EPS * reach_of(scene), rigid_bodies(solution)
    for joint in scene.joints:
        at_outputs = JointAtOutputs(solution, joint, rigid, unit=True)
        for row in at_outputs.rows():
            size, unit = _size(row, at_outputs.owners)
            allowed = PARTED * scene.length + rounding if unit == "m" else PARTED + rounding / scene.length
            if (size > allowed).any():
                k = int((size > allowed).argmax())
                body = scene.place(joint.places[0]).body.name
                message = f"{shown(joint)} is not kept, by {size[k]:.2g} {unit} at {{when}}; {ADVICE}"
                yield Finding(k, "failed", message, body)
                break
    yield from _strained(solution, rigid, rounding)


def _size(row: Linearised, owners: list[tuple[int, int]]) -> tuple[np.ndarray, str]:
    """By how much an equation of a joint is not kept, (n,), and the unit: its value over its steepest slope."""
    steep = np.max([np.linalg.norm(slope, axis=(1, 2)) for slope in row.slopes.values()], axis=0)
    value = np.linalg.norm(row.value, axis=1)
    unit = "m" if any(owners[vector][1] == 0 for vector in row.slopes) else "rad"
    return value * np.sqrt(row.value.shape[1]) / np.maximum(steep, 1e-300), unit


def _strained(solution: Solution, rigid: frozenset[str], rounding: float) -> Iterator[Finding]:
    for body in solution.scene.beams:
        field = solution.fields[body.name]
        if not isinstance(field, HermiteField) or body.name not in rigid:
            continue
        ends = field.coordinates[:, -1, 0] - field.coordinates[:, 0, 0]
        strain = np.abs(np.linalg.norm(ends, axis=1) / body.length - 1.0)
        bad = strain > 0.01 * PARTED + rounding / body.length
        if bad.any():
            k = int(bad.argmax())
            size = f"{strain[k]:.2g} of itself at {{when}}"
            message = f"rigid body {body.name!r} has changed its length by {size}; {ADVICE}"
            yield Finding(k, "failed", message, body.name)
