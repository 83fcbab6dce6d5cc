"""Exact solutions, in closed form or computed to round-off, without finite elements.

Static cantilevers of three continua (`cantilever_static`, `solve_static`, `solve_rod`, `solve_director`), their closed
forms, the elastic catenary, natural frequencies, the rigid motions to which stiff beams converge, and mechanisms of
rigid bodies.
"""

from reference.exact.andrews import andrews_squeezer
from reference.exact.cantilever import Cantilever
from reference.exact.catenary import Catenary
from reference.exact.closed_forms import (
    inextensible_tip,
    moment_arc,
    poisson_locking_factor,
    timoshenko_tip_deflection,
)
from reference.exact.director import DirectorShape, graded_breaks, solve_director
from reference.exact.frequencies import (
    axial_frequencies,
    euler_bernoulli_frequencies,
    timoshenko_frequencies,
)
from reference.exact.mechanisms import OffsetDoublePendulum, Oscillator, slider_crank
from reference.exact.pendulums import Pendulum, bar_reduced_length
from reference.exact.rods import Rigidity, RodShape, solve_rod
from reference.exact.scenes import cantilever_problem, cantilever_static, solve_static

__all__ = [
    "Cantilever",
    "Catenary",
    "DirectorShape",
    "OffsetDoublePendulum",
    "Oscillator",
    "Pendulum",
    "Rigidity",
    "RodShape",
    "andrews_squeezer",
    "axial_frequencies",
    "bar_reduced_length",
    "cantilever_problem",
    "cantilever_static",
    "euler_bernoulli_frequencies",
    "graded_breaks",
    "inextensible_tip",
    "moment_arc",
    "poisson_locking_factor",
    "slider_crank",
    "solve_director",
    "solve_rod",
    "solve_static",
    "timoshenko_frequencies",
    "timoshenko_tip_deflection",
]
