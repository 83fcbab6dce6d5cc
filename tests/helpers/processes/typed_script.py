"""A script as users write it: lists, arrays, generators, functions. Nothing runs it; a type checker reads it."""

import numpy as np

import anctmm as at

steel = at.Material(E=2e8, density=1500.0)
bodies = [at.Beam(f"b{k}", (k * 0.1, 0.0), ((k + 1) * 0.1, 0.0), at.Circle(0.01), steel) for k in range(3)]
plate = at.RigidBody(
    "plate", mass=0.5, inertia=1e-3, center=[0.4, 0.0], points={"a": (0.3, 0.0), "b": [0.5, 0.1]}
)
mass = at.PointMass("m", mass=0.1, position=np.array([0.6, 0.0]))


def force(t: float) -> tuple[float, float]:
    return (0.0, -5.0 if t > 0.1 else 0.0)


kick = at.History(force, breaks=[0.1])
times = at.History(lambda t: (0.0, -5.0), breaks=np.linspace(0, 1, 3))
joints = [at.Clamp("b0.start", angle=at.Quintic(turn=1.0, duration=0.5))]
pins = [at.Pin("b0.end", "b1.start"), at.Pin("b2.end", "plate.a")]
joints2 = [at.Clamp("b0.start"), *pins, at.Weld("b1.end", "b2.start")]
loads = [
    at.Force("b1.end", kick),
    at.Force(("b1", 0.5), (0, -1)),
    at.Torque("b2.end", 0.1),
    at.LineLoad("b0", (0, -2)),
]
connectors = [at.Spring("plate.b", "m.center", stiffness=5), at.RotationalSpring("plate.a", stiffness=1.0)]
scene = at.Scene("s", [*bodies, plate, mass], joints2, loads, gravity=[0, -9.81], connectors=connectors)
other = at.Scene("s", bodies, joints=(j for j in joints2), loads=loads, gravity=np.array([0.0, -9.81]))
third = at.Scene("s", tuple(bodies), joints)
run = at.Discretisation(mesh={"b0": 2, "b1": 2, "b2": 2}, dt=1e-3, t_end=0.1)
solution = at.solve(scene, run)
again = at.solve(scene, mesh=4, dt=1e-3, t_end=0.1, element={"b0": "cable", "b1": "shear", "b2": "rigid"})
case = at.Case(scene, ["b0.end", ("b1", 0.5)], t_end=0.1)
CASES = [case, at.Case(scene, probes=("b0.end",), t_end=None)]
at.compare(solution, again, probes=["b0.end", ("b1", 0.5)])
x = solution.position("b0", 0.5)[-1]
y = solution.section_force("b0", [0.1, 0.5])
print(solution.energy.balance[-1], x, y, solution.reaction(joints2[1]))
at.solve(scene, integrator=at.GeneralizedAlpha(spectral_radius=0.9), dt=1e-3, t_end=0.1, mesh=2)
frame = solution.to_frame(["b0.end"])
static = at.solve_static(other, mesh=4)
modes = at.modes(third, mesh=8)


def law(elongation: float, rate: float, t: float) -> float:
    return 2.0 * elongation + 0.1 * rate


def angle(t: float) -> tuple[float, float, float]:
    return (0.1 * t**2, 0.2 * t, 0.2)


driven = [at.Clamp("b0.start", angle=angle), at.Weld("b0.end", "b1.start", angle=lambda t: (0.0, 0.0, 0.0))]
guided = [
    at.Slider("plate.a", direction=[1, 0]),
    at.Prismatic("m.center", np.array([0.0, 1.0]), position=angle),
]
sprung = at.Spring("plate.b", [1.0, 0.5], law=law, length=lambda t: (0.2, 0.0))
fourth = at.Scene("s", [*bodies, plate, mass], [*driven, *guided], connectors=[sprung])
print(solution.tension(connectors[0]), solution.plot(times=[0.0, 0.1]), fourth.bodies[0].name)
