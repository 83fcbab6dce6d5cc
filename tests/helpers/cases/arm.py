"""A soft arm that falls about a pin: the smallest case whose mesh and step matter."""

import anctmm as at

RUBBER = at.Material(E=1e7, density=1000.0)
arm = at.Beam("arm", (0.0, 0.0), (0.4, 0.0), at.Rectangle(0.02, 0.01), RUBBER)
scene = at.Scene("arm", [arm], [at.Pin("arm.start")], gravity=(0.0, -9.81))
CASES = [at.Case(scene, ["arm.end"], t_end=0.1, output_dt=0.01)]
