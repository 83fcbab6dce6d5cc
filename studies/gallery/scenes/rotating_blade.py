"""Rotating blade: a blade is brought to speed; turning makes it stiffer, and its frequencies rise."""

import numpy as np

import anctmm as at

steel, section = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.05, 0.004)
blade = at.Beam("blade", (0, 0), (1, 0), section, steel)
scene = at.Scene("rotating-blade", [blade], [at.Clamp("blade.start", angle=at.Quintic(6.0, 0.5))])
CASES = [at.Case(scene, ["blade.end"], t_end=0.6, output_dt=0.005)]
RUN = {"mesh": 8, "dt": 2.5e-3}


def known(s):
    unit = np.sqrt(steel.E * section.second_moment / (steel.density * section.area))
    lag = at.modes(scene, mesh=24, count=1, spin=5 * unit).frequencies[0]
    flap = np.hypot(2 * np.pi * lag / unit, 5)
    what = "flap frequency at speed 5, both without unit"
    return what, flap, 6.4495, 2e-4, "", "Wright et al. 1982, J. Appl. Mech. 49"
