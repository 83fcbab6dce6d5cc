"""Arrays that kernels take have one layout in all scenes: each layout would be compiled for itself."""

import numpy as np
import pytest
from samples import beam

import anctmm as at
from anctmm.discretise import kept_chains
from anctmm.integrators import generalized_alpha, zhai
from anctmm.jit.interpreting import interpreted

PLATE = at.RigidBody(
    "plate", 1.0, 0.1, (1.0, 0.5), {"corner": (1.0, 0.0), "edge": (1.5, 0.5), "top": (1.0, 1.0)}
)
ROW = [beam(), beam("b", (1.0, 0.0), (1.0, 1.0))]
LOOP = [*ROW, beam("c", (1.0, 1.0), (0.0, 0.0))]
HINGES = [at.Pin("a.end", "b.start"), at.Pin("b.end", "c.start"), at.Pin("c.end", "a.start")]
TURN = at.Quintic(1.0, 1.0)
SCENES = {
    "row": at.Scene("row", ROW, [at.Pin("a.start"), at.Pin("a.end", "b.start")]),
    "driven": at.Scene(
        "driven", ROW, [at.Clamp("a.start", TURN), at.Weld("a.end", "b.start")], [at.Torque("b.end", 1.0)]
    ),
    "loop": at.Scene("loop", LOOP, HINGES),
    "plate": at.Scene("plate", [beam(), PLATE], [at.Pin("a.start"), at.Pin("a.end", "plate.corner")]),
    "turned": at.Scene("turned", [beam(), PLATE], [at.Clamp("plate.edge", TURN), at.Pin("a.end", "plate.corner")]),
    "guided": at.Scene("guided", ROW, [at.Slider("a.start", (1.0, 0.0)), at.Pin("a.end", "b.start")]),
    "springs": at.Scene(
        "springs",
        [*LOOP, PLATE],
        [*HINGES, at.Pin("plate.top", "b.end")],
        connectors=[
            at.Spring("a.start", "plate.edge", stiffness=1.0),
            at.Spring("c.end", (2.0, 2.0), stiffness=1.0),
            at.RotationalSpring("a.start", "c.end", stiffness=0.1),
        ],
    ),
}  # fmt: skip


def arrays(thing, name=""):
    """All arrays in nested tuples, by name."""
    if isinstance(thing, np.ndarray):
        yield name, thing
    elif isinstance(thing, tuple):
        for part, one in zip(getattr(thing, "_fields", range(len(thing))), thing, strict=True):
            yield from arrays(one, f"{name}.{part}")


@pytest.mark.parametrize("module", [zhai, generalized_alpha])
@pytest.mark.parametrize("name", SCENES)
def test_all_arrays_of_a_scene_are_contiguous(name, module, monkeypatch):
    calls = []
    monkeypatch.setattr(module, "advance", lambda *arguments: calls.append(arguments) or 0)
    integrator = "zhai" if module is zhai else "generalized-alpha"
    kept_chains.forget()
    with interpreted():
        at.solve(SCENES[name], mesh=2, integrator=integrator, dt=1e-5, t_end=2e-5)
    kept_chains.forget()
    found = dict(arrays(calls[-1]))
    assert len(found) > 20
    assert [key for key, array in found.items() if not array.flags.c_contiguous] == []
