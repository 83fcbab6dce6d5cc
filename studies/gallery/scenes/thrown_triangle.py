"""A triangle of three soft bars, welded at its corners, is thrown into the air with a spin."""

import anctmm as at

rubber, section = at.Material(E=5e6, density=1100.0), at.Rectangle(0.02, 0.01)
corners = [(0.0, 0.0), (0.3, 0.0), (0.15, 0.26)]
names = ("bottom", "right", "left")


def bar(name, start, end):
    thrown = at.RigidVelocity(start, end, center=(0.15, 0.26 / 3), spin=9.0, velocity=(2.0, 4.0))
    return at.Beam(name, start, end, section, rubber, thrown)


scene = at.Scene(
    "thrown-triangle",
    [bar(n, corners[k], corners[k - 2]) for k, n in enumerate(names)],
    [at.Weld(f"{names[k - 1]}.end", f"{names[k]}.start") for k in range(3)],
    gravity=(0, -9.81),
)
CASES = [at.Case(scene, ["bottom.start", ("right", 0.5)], t_end=0.8, output_dt=0.01)]
