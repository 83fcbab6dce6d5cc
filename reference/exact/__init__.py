"""Exact solutions, in closed form or computed to round-off, without finite elements.

Static cantilevers of three continua (`cantilever_static`, `solve_static`, `solve_rod`, `solve_director`), the arc, the
elastic catenary, natural frequencies, and Andrews' squeezing mechanism.
"""

from reference.exact.andrews import andrews_squeezer
from reference.exact.cantilever import Cantilever, moment_arc
from reference.exact.catenary import Catenary
from reference.exact.director import DirectorShape, solve_director
from reference.exact.frequencies import axial_frequencies, euler_bernoulli_frequencies
from reference.exact.rods import Rigidity, RodShape, solve_rod
from reference.exact.scenes import cantilever_problem, cantilever_static, solve_static

__all__ = [
    "Cantilever",
    "Catenary",
    "DirectorShape",
    "Rigidity",
    "RodShape",
    "andrews_squeezer",
    "axial_frequencies",
    "cantilever_problem",
    "cantilever_static",
    "euler_bernoulli_frequencies",
    "moment_arc",
    "solve_director",
    "solve_rod",
    "solve_static",
]
