"""ANC-TMM: absolute nodal coordinate transfer matrix method for large-deformation flexible beams."""

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.methods import Esdirk, GeneralizedAlpha, Zhai
from anctmm.model.bodies import distance
from anctmm.model.case import Case
from anctmm.model.connectors import RotationalSpring, Spring
from anctmm.model.consistent import consistent_velocities
from anctmm.model.drives import History, Pulse, Quintic
from anctmm.model.expressions import signal
from anctmm.model.joints import Joint, Prismatic, Revolute, Slider
from anctmm.model.loads import LineLoad
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Circle, Rectangle, Section
from anctmm.model.velocities import RigidVelocity
from anctmm.results.ended_early import HistoryError, Interrupted
from anctmm.results.metrics import Comparison, compare
from anctmm.results.solution import Cost, Energy, Solution, load
from anctmm.results.status import Status
from anctmm.simulator import Simulator
from anctmm.small_motions import Campbell, Modes, campbell
from anctmm.solve import modes, solve, solve_static

__all__ = [
    "Beam", "Campbell", "Case", "Circle", "Clamp", "Comparison", "Cost", "Discretisation", "Energy", "Esdirk",
    "Force", "GeneralizedAlpha", "History", "HistoryError", "Interrupted", "Joint", "LineLoad", "Material",
    "Modes", "Pin", "PointMass", "Prismatic", "Pulse", "Quintic", "Rectangle", "Revolute", "RigidBody",
    "RigidVelocity", "RotationalSpring", "Scene", "Section", "Simulator", "Slider", "Solution", "Spring",
    "Status", "Torque", "Weld", "Zhai", "campbell", "compare", "consistent_velocities", "distance", "load",
    "modes", "signal", "solve", "solve_static",
]  # fmt: skip
