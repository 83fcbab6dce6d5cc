"""What must hold for every scene: nothing depends on direction, place, cut, order or units; what motion keeps.

Scenes are drawn at random (`random_scenes`), by default the same few each time;
`pytest tests/integrators/test_properties.py
--hypothesis-profile thorough` tries many new ones.
"""

from dataclasses import replace
from math import sin

import numpy as np
from hypothesis import given, note
from random_scenes import structures
from samples import bar, system_of

from anctmm.solve import solve, solve_static

EPS = float(np.finfo(float).eps)
TOLERANCE = 1e-12
#: Steps of a run, Δt ω_max (explicit below the limit of 2, implicit above), and the longest Δt, s.
METHODS = {"zhai": (200, 1.0, 1.0), "generalized-alpha": (40, 30.0, 5e-4), "statics": (1, 1.0, 1.0)}


def answer(method, drawn, dt, **options):
    """Solution of a drawn scene by a method."""
    if method == "statics":
        found = solve_static(drawn.scene, mesh=drawn.mesh, element=drawn.element, newton_tolerance=TOLERANCE)
    else:
        run = {
            "dt": dt,
            "t_end": METHODS[method][0] * dt,
            "newton_tolerance": TOLERANCE,
            "check_stability": False,
        }
        found = solve(
            drawn.scene, mesh=drawn.mesh, element=drawn.element, integrator=method, **{**run, **options}
        )
    assert found.status.ok, found.status
    return found


# --- place and direction -----------------------------------------------------------------------------------


# --- cut, order, units -------------------------------------------------------------------------------------


def test_slope_of_an_initial_velocity_is_found_as_well_in_any_unit():
    for speed in (2.0**-60, 1.0, 2.0**60):
        scene = bar(velocity=lambda s, speed=speed: (speed * sin(12.0 * s), 0.0))
        mesh = system_of(scene, mesh=4).bodies.meshes[0]
        exact = 12.0 * speed * np.cos(12.0 * np.linspace(0.0, 1.0, 5))
        assert np.abs(mesh.initial_velocity[:, 1, 0] - exact).max() < 1e-9 * speed


# --- what motion keeps -------------------------------------------------------------------------------------


# --- equilibrium -------------------------------------------------------------------------------------------


@given(drawn=structures(kinds=("shear",), torques=False))
def test_halving_shear_elements_never_raises_the_potential_energy_at_rest(drawn):
    """The space of the coarse mesh lies in that of the fine one, and five Gauss points integrate the energy exactly.

    So equilibrium is a minimum over more. Nothing promises it for cables: their energy is no polynomial, no rule
    integrates it exactly, and the error of a rule changes with the mesh.
    """
    fine = replace(drawn, mesh={name: 2 * n for name, n in drawn.mesh.items()})
    coarse, halved = (answer("statics", d, None).energy for d in (drawn, fine))
    one, two = (e.strain[-1] + e.potential[-1] for e in (coarse, halved))
    rounding = EPS * sum(b.material.E * b.section.area * b.length for b in drawn.scene.bodies)
    note(f"{one} J, halved {two} J, rounding {rounding} J")
    assert two < 0.0
    assert two <= one + rounding
