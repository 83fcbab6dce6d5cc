"""Clamps and welds that leave the stretch free: beside the global DAE, exact solutions and a published value."""

from math import cos, pi, sin

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

SECTION, SOFT = at.Rectangle(0.01, 0.01), at.Material(E=1e7, density=2700.0)
DOWN = (0.0, -9.81)
DRIVE = at.Quintic(turn=pi / 2, duration=0.5)


def beam(name, start, end):
    return at.Beam(name, start, end, SECTION, SOFT)


def frame(angle=None):
    bodies = [beam("a", (0, 0), (0.5, 0)), beam("b", (0.5, 0), (0.5, 0.3)), beam("c", (0.5, 0), (0.9, -0.1))]
    fork = at.Weld("a.end", "b.start", "c.start", stretch="free")
    return at.Scene("frame", bodies, [at.Clamp("a.start", angle, "free"), fork], gravity=DOWN)


def hinged():
    weld = at.Weld("a.end", "b.start", angle=DRIVE, stretch="free")
    bodies = [beam("a", (0, 0), (0.5, 0)), beam("b", (0.5, 0), (0.9, 0))]
    return at.Scene("hinged", bodies, [at.Clamp("a.start", stretch="free"), weld], gravity=DOWN)


def handed():
    hand = at.RigidBody("hand", 0.1, 1e-4, (0.52, 0.01), {"w": (0.5, 0)})
    joints = [at.Clamp("a.start", stretch="free"), at.Weld("a.end", "hand.w", stretch="free")]
    return at.Scene("handed", [beam("a", (0, 0), (0.5, 0)), hand], joints, gravity=DOWN)


def ring():
    corners = [(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5)]
    bodies = [beam(n, corners[k], corners[(k + 1) % 4]) for k, n in enumerate("abcd")]
    joints = [at.Weld(f"{m}.end", f"{n}.start", stretch="free") for m, n in ("ab", "bc", "cd", "da")]
    return at.Scene("ring", bodies, joints, [at.Force("a.end", (1, 1)), at.Force("c.end", (-1, -1))])


def inside():
    bodies = [beam("a", (0, 0), (1, 0)), beam("b", (0.5, 0), (0.5, 0.4))]
    joints = [at.Clamp("a.start", stretch="free"), at.Weld(("a", 0.5), "b.start", stretch="free")]
    return at.Scene("inside", bodies, joints, gravity=DOWN)


SCENES = {
    "fixed": frame(),
    "driven": frame(DRIVE),
    "hinged": hinged(),
    "hand": handed(),
    "ring": ring(),
    "inside": inside(),
}
MOVING = {
    "implicit": ({"dt": 2e-3, "t_end": 0.02, "output_dt": 2e-3, "newton_tolerance": 1e-11}, 1e-8),
    "explicit": ({"dt": 1e-5, "t_end": 1e-3, "output_dt": 1e-4, "integrator": "zhai"}, 1e-9),
}


def probes(scene):
    return [f"{b.name}.end" if isinstance(b, at.Beam) else f"{b.name}.center" for b in scene.bodies]


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("steps", MOVING)
@pytest.mark.parametrize("name", SCENES)
def test_motions_and_reactions_are_those_of_the_global_dae(name, steps, element):
    scene, (options, bound) = SCENES[name], MOVING[steps]
    ours, dae = (solver(scene, mesh=2, element=element, **options) for solver in (at.solve, global_dae.solve))
    assert ours.status.ok
    assert dae.status.ok
    assert at.compare(ours, dae, probes=probes(scene)).error < bound
    forces = [s.reaction(scene.joints[0]) for s in (ours, dae)]
    assert (
        np.abs(forces[0] - forces[1]).max()
        < (2e-2 if steps == "implicit" else 1e-5) * np.abs(forces[1]).max()
    )


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("name", ["fixed", "hand", "inside"])
def test_equilibria_are_those_of_the_global_dae(name, element):
    ours, dae = (s(SCENES[name], mesh=2, element=element) for s in (at.solve_static, global_dae.solve_static))
    assert ours.status == "ok"
    assert ours.status.message == ""
    assert at.compare(ours, dae, probes=probes(SCENES[name])).error < 1e-8


@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize("mesh", [1, 4])
def test_a_pulled_bar_is_as_long_as_it_should_be(angle, mesh):
    """PL/EA, exact on any mesh; a clamp that holds the stretch leaves it short by an eighth of an element's part."""
    along, pull = np.array([cos(angle), sin(angle)]), 50.0
    exact = pull / (SOFT.E * SECTION.area)
    longer = {}
    for stretch in ("free", "held"):
        joints = [at.Clamp("a.start", stretch=stretch)]
        scene = at.Scene(
            "bar", [beam("a", (0, 0), tuple(along))], joints, [at.Force("a.end", tuple(pull * along))]
        )
        longer[stretch] = float(np.linalg.norm(at.solve_static(scene, mesh=mesh).displacement("a.end")[-1]))
    assert longer["free"] == pytest.approx(exact, rel=1e-12)
    assert longer["held"] == pytest.approx(exact * (1.0 - 0.125 / mesh), rel=0.02)


def test_order_of_a_hanging_bar():
    """Its own weight: held, the error falls with the mesh; free, with its fourth power, so that four elements do."""
    exact = SOFT.density * 9.81 / (2.0 * SOFT.E)
    errors = {}
    for stretch in ("free", "held"):
        scene = at.Scene(
            "bar", [beam("a", (0, 0), (0, -1))], [at.Clamp("a.start", stretch=stretch)], gravity=DOWN
        )
        errors[stretch] = [
            abs(float(at.solve_static(scene, mesh=n).displacement("a.end")[-1, 1]) / -exact - 1.0)
            for n in (4, 8)
        ]
    assert max(errors["free"]) < 1e-9
    assert errors["held"][0] / errors["held"][1] == pytest.approx(2.0, rel=0.05)
    assert errors["held"][0] > 1e-2


def test_what_cannot_be_is_refused():
    with pytest.raises(at.errors.UnknownOptionError, match=r"clamp .* stretch is 'loose'; .*free.*held"):
        at.Clamp("a.start", stretch="loose")
    with pytest.raises(at.errors.UnknownOptionError, match=r"weld of .* stretch is 1"):
        at.Weld("a.end", "b.start", stretch=1)
    bodies = [beam("a", (0, 0), (0.5, 0)), beam("b", (0.5, 0), (0.9, 0))]
    with pytest.raises(at.errors.RepeatedJointError, match=r"Clamp.*'a.start'.* already"):
        at.Scene("twice", bodies[:1], [at.Clamp("a.start", stretch="free"), at.Clamp("a.start")])
    assert "stretch='free'" in repr(at.Weld("a.end", "b.start", stretch="free"))
