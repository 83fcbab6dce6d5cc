"""Soft pendulum: a bar of rubber falls from the horizontal and bends strongly; its energy is conserved."""

import anctmm as at

rubber = at.Material(E=2e7, density=1100.0)
bar = at.Beam("bar", (0, 0), (1, 0), at.Circle(0.012), rubber)
scene = at.Scene("soft-pendulum", [bar], [at.Pin("bar.start")], gravity=(0, -9.81))
CASES = [at.Case(scene, ["bar.end", ("bar", 0.5)], t_end=0.9, output_dt=0.01)]
RUN = {"mesh": 12, "dt": 2.5e-3}


def known(s):
    change = abs(s.energy.balance).max() / abs(s.energy.potential).max()
    return "largest change of energy, of the potential one", change, 0.0, 1e-3, "", "conservation"
