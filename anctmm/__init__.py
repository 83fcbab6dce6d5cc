"""ANC-TMM: absolute nodal coordinate transfer matrix method for large-deformation flexible beams."""

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.methods import Esdirk, GeneralizedAlpha, Zhai
from anctmm.model.case import Case
from anctmm.model.consistent import consistent_velocities
from anctmm.model.drives import History, Pulse, Quintic
from anctmm.model.expressions import signal
from anctmm.model.joints import Joint
from anctmm.model.scene import (
    Beam,
    Clamp,
    Force,
    LineLoad,
    Material,
    Pin,
    PointMass,
    Prismatic,
    Revolute,
    RigidBody,
    RotationalSpring,
    Scene,
    Slider,
    Spring,
    Torque,
    Weld,
    distance,
)
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
    "Beam",
    "Campbell",
    "Case",
    "Circle",
    "Clamp",
    "Comparison",
    "Cost",
    "Discretisation",
    "Energy",
    "Esdirk",
    "Force",
    "GeneralizedAlpha",
    "History",
    "HistoryError",
    "Interrupted",
    "Joint",
    "LineLoad",
    "Material",
    "Modes",
    "Pin",
    "PointMass",
    "Prismatic",
    "Pulse",
    "Quintic",
    "Rectangle",
    "Revolute",
    "RigidBody",
    "RigidVelocity",
    "RotationalSpring",
    "Scene",
    "Section",
    "Simulator",
    "Slider",
    "Solution",
    "Spring",
    "Status",
    "Torque",
    "Weld",
    "Zhai",
    "campbell",
    "compare",
    "consistent_velocities",
    "distance",
    "load",
    "modes",
    "signal",
    "solve",
    "solve_static",
]
