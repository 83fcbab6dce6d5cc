"""Integrators as objects: the same as their names with parameters beside them."""

import pytest
from samples import refused

import anctmm as at
from anctmm.errors import DiscretisationError


@pytest.mark.parametrize(
    ("method", "options"),
    [
        (at.Zhai(), {"integrator": "zhai"}),
        (at.Zhai(psi=0.6, phi=0.6), {"integrator": "zhai", "psi": 0.6, "phi": 0.6}),
        (at.GeneralizedAlpha(), {}),
        (at.GeneralizedAlpha(0.5), {"spectral_radius": 0.5}),
        (at.Esdirk(), {"integrator": "esdirk"}),
    ],
)
def test_a_method_is_its_name_and_parameters(method, options):
    whole = at.Discretisation(mesh=2, integrator=method)
    assert whole == at.Discretisation(mesh=2, **options)
    assert repr(whole) == repr(at.Discretisation(mesh=2, **options))
    assert whole.method == method
    assert whole.explicit == (type(method) is at.Zhai)


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"dt": 1e-3}, "generalized-alpha"),
        ({"tolerance": 1e-3}, "esdirk"),
        ({"tolerance": 1e-3, "spectral_radius": 0.5}, "generalized-alpha"),
        ({"tolerance": 1e-3, "integrator": "generalized-alpha"}, "generalized-alpha"),
        ({"tolerance": 1e-3, "integrator": at.GeneralizedAlpha()}, "generalized-alpha"),
    ],
)
def test_the_usual_method_depends_on_who_chooses_the_steps(options, name):
    run = at.Discretisation(mesh=2, **options)
    assert run.integrator == name
    assert run == at.Discretisation(mesh=2, **options | {"integrator": name})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: at.Zhai(psi="half"), ["psi", "'half'", "number"]),
        (lambda: at.Zhai(phi=float("nan")), ["phi", "nan"]),
        (lambda: at.GeneralizedAlpha(1.5), ["spectral_radius", "1.5", "[0"]),
        (
            lambda: at.Discretisation(mesh=1, integrator=at.Zhai(psi=0.6), psi=0.7),
            ["psi", "0.7", "Zhai(psi=0.6"],
        ),
        (lambda: at.Discretisation(mesh=1, integrator=at.Zhai), ["integrator", "Zhai", "'zhai'"]),
        (lambda: at.Discretisation(mesh=1, integrator="newmark"), ["integrator", "'newmark'", "'zhai'"]),
        (
            lambda: at.Discretisation(mesh=1, integrator=at.Zhai(), tolerance=1e-3),
            ["tolerance", "'zhai'", "'esdirk'", "'generalized-alpha'", "stability"],
        ),
    ],
)
def test_wrong_methods_are_refused_by_name(make, words):
    with refused(DiscretisationError, words):
        make()
