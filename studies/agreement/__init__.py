"""Do all solvers compute the same motion?"""
