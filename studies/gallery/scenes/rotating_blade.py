"""A blade is brought to speed; turning makes it stiffer, and its frequencies rise."""

import anctmm as at

steel, section = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.05, 0.004)
blade = at.Beam("blade", (0, 0), (1, 0), section, steel)
scene = at.Scene("rotating-blade", [blade], [at.Clamp("blade.start", angle=at.Quintic(6.0, 0.5))])
CASES = [at.Case(scene, ["blade.end"], t_end=0.6, output_dt=0.005)]
