"""ANC-TMM: absolute nodal coordinate transfer matrix method for planar large-deformation flexible beams."""

from anctmm.discretisation import Discretisation
from anctmm.drives import Pulse, Quintic
from anctmm.metrics import Comparison, compare
from anctmm.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld, distance
from anctmm.sections import Circle, Rectangle, Section
from anctmm.solution import Cost, Energy, Solution, Status
from anctmm.solve import solve
from anctmm.statics import solve_static

__all__ = [
    "Beam",
    "Circle",
    "Clamp",
    "Comparison",
    "Cost",
    "Discretisation",
    "Energy",
    "Force",
    "Material",
    "Pin",
    "Pulse",
    "Quintic",
    "Rectangle",
    "Scene",
    "Section",
    "Solution",
    "Status",
    "Torque",
    "Weld",
    "compare",
    "distance",
    "solve",
    "solve_static",
]
