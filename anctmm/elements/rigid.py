"""A rigid bar as an element: the coordinates and the mass of a cable without stiffness.

ANC-TMM has one node for it instead, in natural coordinates (`anctmm.system.body_meshes`).
Restricted to rigid motions, where r = r_I + x t, the cable's mass is exactly that of a thin bar: m, m l/2 about an end
and m l²/3. So a rigid body is the limit of a cable of ever greater stiffness; like it, it has no rotary inertia of its
section.
"""

from anctmm.elements.cable import CableElement
from anctmm.model.scene import Beam


class RigidElement(CableElement):
    """The one element of a rigid body."""

    @classmethod
    def of(cls, body: Beam, elements: int = 1, quadrature: str = "full") -> "RigidElement":
        """The element of a body; `elements` and `quadrature` mean nothing to it."""
        return cls(body.length, 0.0, 0.0, body.material.density * body.section.area)
