"""A kind that a road does not know is refused there by name: none takes it for another kind, so none agrees in error.

Scenes and discretisations refuse such kinds themselves; here they are put in behind their backs, as a kind is that is
added to the model and forgotten in a road.
"""

from itertools import combinations

import pytest
from samples import SOFT, SQUARE, beam, scene_of

import anctmm as at
from anctmm.discretise.discretisation import INTEGRATORS
from anctmm.elements.kinds import KINDS, QUADRATURES
from anctmm.errors import SceneError, UnknownKindError, UnknownOptionError
from anctmm.model.bodies import BODIES
from anctmm.model.joints import JOINTS
from anctmm.model.loads import LOADS
from anctmm.solvers.registry import names
from reference import exact, exudyn_cable, exudyn_reissner, global_dae, opensees, pyelastica
from studies.engine.other_numbers import Change

#: Every road from a scene to an answer: of motion, of equilibrium.
MOTION = {
    "anctmm": at.solve,
    "global-dae": global_dae.solve,
    "global-dae-dense": global_dae.solve_dense,
    "exudyn-cable": exudyn_cable.solve,
    "exudyn-reissner": exudyn_reissner.solve,
    "opensees": opensees.solve,
    "pyelastica": pyelastica.solve,
}
STATIC = {
    "anctmm": at.solve_static,
    "global-dae": global_dae.solve_static,
    "exudyn-cable": exudyn_cable.solve_static,
    "exudyn-reissner": exudyn_reissner.solve_static,
    "opensees": opensees.solve_static,
    "pyelastica": pyelastica.solve_static,
}
ROADS = {
    **{f"{name}, {integrator}": (solve, integrator) for name, solve in MOTION.items() for integrator in INTEGRATORS},
    **{f"{name}, statics": (solve, None) for name, solve in STATIC.items()},
}  # fmt: skip
for other in ("pyelastica, generalized-alpha", "pyelastica, esdirk", "opensees, zhai", "opensees, esdirk"):
    del ROADS[other]  # it has no such steps, whatever the scene
every_road = pytest.mark.parametrize("road", ROADS)


class Slider:
    """A joint of no known kind with all that a pin and a clamp have."""

    def __init__(self, *ends, grounded=False):
        self.ends, self.grounded, self.end, self.angle = ends, grounded, ends[0], None


class Pressure:
    """A load of no known kind."""

    def __init__(self, value):
        self.end, self.value = "b.end", value


class Plate:
    """A body of no known kind with all that a beam has."""

    def __init__(self, like):
        self.__dict__.update(vars(like))
        self.length, self.angle = like.length, like.angle

    def velocity_at(self, fraction):
        return (0.0, 0.0)


def smuggled(thing, **values):
    """The same frozen value with other fields, unchecked."""
    for name, value in values.items():
        object.__setattr__(thing, name, value)
    return thing


def clamped():
    return scene_of(at.Clamp("b.start"), bodies=[beam("b")])


def asked(road, scene, **wrong):
    solve, integrator = ROADS[road]
    run = at.Discretisation(mesh=2, integrator=integrator or INTEGRATORS[0], dt=1e-5, t_end=2e-5)
    return solve(scene, smuggled(run, **wrong))


@every_road
@pytest.mark.parametrize("ends", [("b.end",), ("b.start",), ("b.end", "c.start")])
@pytest.mark.parametrize("grounded", [False, True])
def test_a_foreign_joint(road, ends, grounded):
    bodies = [beam("b"), beam("c", (1.0, 0.0), (2.0, 0.0))]
    scene = smuggled(scene_of(bodies=bodies), joints=(Slider(*ends, grounded=grounded),))
    with pytest.raises(UnknownKindError, match=r"joint is .*Slider.*allowed here are Pin, Weld, Clamp"):
        asked(road, scene)


@every_road
@pytest.mark.parametrize("value", [1.0, (0.0, 1.0), lambda t: 1.0, lambda t: (0.0, 1.0)])
def test_a_foreign_load(road, value):
    with pytest.raises(UnknownKindError, match=r"load is .*Pressure.*allowed here are Force, Torque"):
        asked(road, smuggled(clamped(), loads=(Pressure(value),)))


@every_road
def test_a_foreign_body(road):
    scene = clamped()
    plate = Plate(scene.bodies[0])
    with pytest.raises(UnknownKindError, match=r"body is .*Plate.*allowed here are Beam"):
        asked(road, smuggled(scene, bodies=(plate,), _by_name={"b": plate}))


@every_road
def test_a_foreign_element(road):
    with pytest.raises(UnknownOptionError, match=r"element of body 'b' is 'rod'; allowed are"):
        asked(road, clamped(), element="rod")


@pytest.mark.parametrize("road", [r for r in ROADS if "statics" not in r])
def test_a_foreign_integrator(road):
    with pytest.raises(UnknownOptionError, match=r"integrator is 'euler'; allowed are"):
        asked(road, clamped(), integrator="euler")


@pytest.mark.parametrize(
    "road", [r for r in ROADS if not any(peer in r for peer in ("reissner", "opensees", "pyelastica"))]
)
def test_a_foreign_quadrature(road):
    """Those that are left out have one of their own."""
    with pytest.raises(UnknownOptionError, match=r"quadrature is 'exact'; allowed are 'full'"):
        asked(road, clamped(), quadrature="exact")


def test_exact_solutions_refuse_what_they_do_not_know():
    for scene in (
        smuggled(clamped(), loads=(Pressure(1.0),)),
        smuggled(clamped(), bodies=(Plate(beam("b")),)),
        smuggled(clamped(), joints=(Slider("b.start"),)),
    ):
        with pytest.raises(SceneError):
            exact.solve_static(scene)


def test_studies_refuse_what_they_do_not_know():
    scene = smuggled(scene_of(bodies=[beam("b")]), joints=(Slider("b.end"),))
    with pytest.raises(UnknownKindError, match="Slider"):
        Change(turn=0.3).scene(scene)
    with pytest.raises(UnknownKindError, match="Pressure"):
        Change(turn=0.3).scene(smuggled(clamped(), loads=(Pressure(1.0),)))


# --- at the door -------------------------------------------------------------------------------------------


class MyBeam(at.Beam):
    """It might mean anything."""


def test_scenes_refuse_foreign_kinds_and_subclasses():
    mine = MyBeam("b", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)
    for things in (
        {"bodies": [mine]},
        {"bodies": [Plate(beam("b"))]},
        {"joints": [Slider("b.end")]},
        {"loads": [Pressure(1.0)]},
    ):
        with pytest.raises(SceneError, match=r"scene (bodies|joints|loads) hold .*; allowed are"):
            at.Scene(**{"name": "s", "bodies": [beam("b")], **things})


class MyScene(at.Scene):
    """It might mean anything."""


@every_road
@pytest.mark.parametrize("scene", [None, "scene", MyScene("s", [beam("b")])])
def test_what_is_no_scene_is_refused(road, scene):
    with pytest.raises(UnknownKindError, match=r"scene is .*; a Scene is needed"):
        asked(road, scene)


def test_no_kind_is_a_subclass_of_another():
    """A `match` would take it for that."""
    for kinds in (BODIES, JOINTS, LOADS):
        assert not any(issubclass(a, b) or issubclass(b, a) for a, b in combinations(kinds, 2))


def test_the_roads_here_are_all_that_are_registered_and_the_kinds_all_names():
    assert set(names()) >= set(MOTION)
    assert len({*KINDS, *INTEGRATORS, *QUADRATURES}) == 10
