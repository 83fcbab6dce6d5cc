"""Thrown triangle: three soft bars, welded at their corners, fly and turn; their centre of mass follows a parabola."""

import numpy as np
from scipy.integrate import simpson

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
RUN = {"mesh": 4, "dt": 2e-3}


def height(s):  # of the centre of mass: Simpson's rule is exact for cubic elements
    places = np.linspace(0, 1, 9)
    return np.mean([simpson(s.position(n, places)[..., 1], x=places, axis=1) for n in names], axis=0)


def known(s):
    parabola = 0.26 / 3 + 4.0 * s.t[-1] - 9.81 * s.t[-1] ** 2 / 2
    return "height of the centre of mass after 0.8 s", height(s)[-1], parabola, 1e-5, "m", "y₀ + v t − g t²/2"


def curves(s):
    what = "t (s)"
    return what, s.t, "height (m)", {"centre of mass": height(s), "corner": s.position("bottom.start")[:, 1]}
