"""Reactions of joints: their forces on the places that they hold, from the equilibrium of the bodies.

The total force on an end of a flexible beam is known (`section_forces`); that on a rigid body, or on a beam of element
"rigid", is m r̈ and I θ̈ less the other loads on it (`rigid`). Joints that share a place or a rigid body are solved
together, once for all of them (`reaction_equations`).
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import ResultError, UnknownNameError, shown
from anctmm.model.joints import Guide, Joint
from anctmm.model.topology import Sets
from anctmm.results.internal_forces.reaction_equations import JointForces, joint_forces
from anctmm.results.internal_forces.rigid import is_rigid

Array = NDArray[np.float64]


class Reactions:
    """Reactions of the joints of one solution, those of joints that hang together found at once.

    It does not hold the solution, which holds it: its memory is free as soon as nobody needs it.

    Parameters
    ----------
    solution : Solution
    """

    def __init__(self, solution: Any) -> None:
        joints = solution.scene.joints
        if solution.scene.own_joints:
            raise ResultError(
                f"reactions of scene {solution.scene.name!r} are not known, which has "
                f"{solution.scene.own_joints[0]!r}: they are of scenes whose joints are all of the package's kinds"
            )
        self._numbers = {id(joint): k for k, joint in enumerate(joints)}
        self._holders = [list(_holders(solution, joint)) for joint in joints]
        self._together = _together(self._holders)
        self._found: dict[int, JointForces] = {}

    def of(self, solution: Any, joint: Joint) -> Array:
        """What a joint exerts on its first place, (n, 3): N, N, N m, in fixed axes.

        Parameters
        ----------
        solution : Solution
            The same.
        joint : Pin, Weld, Clamp, Slider or Prismatic
            Of the scene.

        Returns
        -------
        ndarray, shape (n, 3)
            Force along x and y, and the moment, counter-clockwise. Of a joint of several places that is grounded it is
            what the ground and the other places exert together; a pin of its own at one of these places tells the
            support's.

        Raises
        ------
        UnknownNameError
            If the joint is not of the scene.
        ResultError
            If the solution does not have what reactions are found from, or the joints repeat each other among rigid
            bodies, so that equilibrium alone does not determine their forces.
        """
        number = self._numbers.get(id(joint))
        if number is None:
            number = _equal(solution.scene, joint)
        if number not in self._found:
            together = self._together[number]
            found = joint_forces(solution, self._holders, together)
            self._found |= dict.fromkeys(together, found)
        found = self._found[number]
        at = found.first[number]
        if found.unknown[:, at : at + 3].any():
            raise ResultError(
                "joints of rigid bodies are redundant here: equilibrium does not determine how they share their "
                "forces; a flexible body is needed among them"
            )
        return found.forces[:, at : at + 3].copy()


def _equal(scene: Any, joint: Joint) -> int:
    """Number of the joint of a scene that is equal to one."""
    if joint not in scene.joints:
        raise UnknownNameError(
            f"joint {shown(joint)} is not in scene {scene.name!r}; one of `scene.joints` is needed, which has "
            f"{len(scene.joints)}"
        )
    return scene.joints.index(joint)  # type: ignore[no-any-return]


def _together(holders: Sequence[Sequence[tuple[str, Any]]]) -> dict[int, list[int]]:
    """Of each joint those that share a place or a rigid body with it, directly or through others."""
    sets = Sets[tuple[str, Any]]()
    for k, held in enumerate(holders):
        for holder in held:
            sets.unite(("joint", k), holder)
    groups = sets.among([("joint", k) for k in range(len(holders))])
    return {k: [n for _, n in group] for group in groups for _, k in group}


def _holders(solution: Any, joint: Joint) -> Iterator[tuple[str, Any]]:
    """Places of beams that bend, and whole rigid bodies, that a joint acts on."""
    for place in map(solution.scene.place, joint.ends):
        yield (place.body.name, "") if is_rigid(solution, place.body) else place.end
    if isinstance(joint, Guide) and joint.body is not None:
        yield joint.body, ""
