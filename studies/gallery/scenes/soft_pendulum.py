"""A soft bar falls from the horizontal and swings about a pin."""

import anctmm as at

rubber = at.Material(E=2e7, density=1100.0)
bar = at.Beam("bar", (0, 0), (1, 0), at.Circle(0.012), rubber)
scene = at.Scene("soft-pendulum", [bar], [at.Pin("bar.start")], gravity=(0, -9.81))
CASES = [at.Case(scene, ["bar.end", ("bar", 0.5)], t_end=0.9, output_dt=0.01)]
