"""How runs end, files, and comparisons of solutions."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers, group
from tests.golden.scenes import ALPHA, ESDIRK, FIRM, ROD, ZHAI, A, B, C, beam, scene, turning
from tests.golden.vary import Variation

SQUARE, RUBBER = at.Rectangle(0.02, 0.02), at.Material(E=1e7, density=1000.0)


def ended(run: Callable[..., at.Solution], *scene: at.Scene, **options: Any) -> str:
    """How a run ends: the code of its status, or the exception."""
    try:
        return run(*scene, **options).status.code
    except Exception as error:  # whatever is raised is an answer
        return f"raises {type(error).__name__}"


def sound(run: Callable[..., at.Solution], *scene: at.Scene, **options: Any) -> str:
    """Whether a run is called ok; which other status it has, or which error of a history is raised, may differ."""
    found = ended(run, *scene, **options)
    if found.startswith("raises") and found not in ("raises HistoryError", "raises PropertyError"):
        raise ValueError(f"the run of an answer {found}: its options are wrong")
    return "ok" if found == "ok" else "not ok"


@group(name="linkage that locks")
def locked(v: Variation) -> Answers:
    """A rigid crank that is driven where the rigid coupler cannot follow."""
    bodies = [beam("crank", A, (0.3, 0.0)), beam("coupler", (0.3, 0.0), (0.9, 0.3), FIRM, ROD)]
    joints = [
        at.Clamp("crank.start", at.Quintic(2.0, 0.05)),
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end"),
    ]
    made = scene("locked", bodies, joints, gravity=(0.0, 0.0))
    quick: dict[str, Any] = {"integrator": "zhai", "dt": 1e-3, "t_end": 0.06, "output_dt": 0.012}
    methods = {"zhai": quick, "generalized-alpha": ALPHA, "esdirk": ESDIRK}
    return {kind: sound(v.solve, made, mesh=1, element="rigid", **steps) for kind, steps in methods.items()}


@group(name="steps that diverge")
def diverging(v: Variation) -> Answers:
    """Explicit steps that are too long: refused, or carried out on demand; forces that no beam can bear."""
    clamp = [at.Clamp("one.start")]
    plain = scene("plain", [beam("one", A, B)], clamp)
    pulled = scene("pulled", [beam("one", A, B)], clamp, [at.Force("one.end", (2e7, 0.0))])
    pushed = scene("pushed", [beam("one", A, B)], clamp, [at.Force("one.end", (-20.0, 15.0))])
    long: dict[str, Any] = {"mesh": 2, "integrator": "zhai", "dt": 1e-2, "t_end": 1.0, "output_dt": 0.5}
    return {
        "above the stability limit": ended(v.solve, plain, **long),
        "above it, unchecked": ended(v.solve, plain, check_stability=False, **long),
        "pulled apart": sound(v.solve, pulled, mesh=2, **ALPHA),
        "inside out": sound(v.solve, pushed, mesh=2, dt=2e-2, t_end=0.2),
        "a free body at rest": sound(v.static, scene("free", [beam("one", A, B)]), mesh=2),
    }


@group(name="energy made by long steps")
def made_energy(v: Variation) -> Answers:
    """A stiff bar that turns fast about a pin."""
    steel = at.Material(E=2e11, density=7800.0)
    bar = turning(beam("bar", A, (0.8, 0.6), steel), A, 50.0)
    made = scene("spun", [bar], [at.Pin("bar.start")], gravity=(0.0, 0.0))
    return {
        "10 ms": sound(v.solve, made, mesh=4, dt=0.01, t_end=0.1),
        "7 ms": sound(v.solve, made, mesh=4, dt=0.007, t_end=0.056),
        "0.1 ms": sound(v.solve, made, mesh=4, dt=1e-4, t_end=0.01),
    }


@group(name="lost digits")
def digits_lost(v: Variation) -> Answers:
    """Far from the origin, and beside stiffness ratios of 3e12 and more."""

    def falling(x: float, y: float) -> at.Scene:
        return at.Scene(
            "far",
            [at.Beam("bar", (x, y), (x + 1.0, y), SQUARE, RUBBER)],
            [at.Clamp("bar.start")],
            gravity=(0.0, -9.81),
        )

    def pulled(stiff: float) -> at.Scene:
        bodies = [
            at.Beam("soft", A, (1.0, 0.0), SQUARE, at.Material(E=100.0, density=1000.0)),
            at.Beam("stiff", (1.0, 0.0), (2.0, 0.0), SQUARE, at.Material(E=stiff, density=1000.0)),
        ]
        joints = [at.Clamp("soft.start"), at.Weld("soft.end", "stiff.start")]
        return at.Scene("pulled", bodies, joints, [at.Force("stiff.end", (0.0, 1e-6))])

    run: dict[str, Any] = {"mesh": 4, "dt": 1e-3, "t_end": 0.25, "output_dt": 0.05}
    long: dict[str, Any] = {"mesh": 1, "dt": 0.025, "t_end": 10.0, "output_dt": 2.5}
    found: Answers = {
        f"at {max(x, -y):g} m": sound(at.solve, falling(x, y), **run)
        for x, y in ((0.0, 0.0), (1e6, 3e5), (1e12, 0.0), (1.0, -3e12))
    }
    flight = at.Scene(
        "flight", [at.Beam("bar", (1e12, 0.0), (1e12 + 1.0, 0.0), SQUARE, RUBBER, lambda s: (1.0, 0.0))]
    )
    quick: dict[str, Any] = {"mesh": 1, "integrator": "zhai", "dt": 1e-4, "t_end": 0.1, "output_dt": 0.05}
    found["flight at 1e12 m"] = sound(at.solve, flight, **quick)
    found |= {f"stiffness {E:g}": sound(at.solve, pulled(E), **long) for E in (1e8, 4e14)}
    return found


@group(name="equilibria that are none")
def unstable(v: Variation) -> Answers:
    """A mechanism, a free body, and an equilibrium that is not stable."""
    upright = scene("upright", [beam("one", A, (0.0, 0.4), FIRM)], [at.Pin("one.start")], gravity=(0.0, -0.1))
    hanging = scene(
        "hanging", [beam("one", A, (0.0, -0.4), FIRM)], [at.Pin("one.start")], gravity=(0.0, -0.1)
    )
    weightless = scene("weightless", [beam("one", A, B)], [at.Pin("one.start")], gravity=(0.0, 0.0))
    return {
        "upright": ended(v.static, upright, mesh=2),
        "hanging": ended(v.static, hanging, mesh=2),
        "mechanism without weight": sound(v.static, weightless, mesh=2),
        "upright, a stable one": ended(v.static, upright, mesh=2, branch="stable"),
    }


def _broken(t: Any) -> Any:
    return (0.0, float("nan")) if float(t) > 0.02 else (0.0, 0.1)


def _missed(t: Any) -> Any:
    return (0.0, -5.0 if 0.0104 <= float(t) < 0.0116 else 0.0)


def _false(t: Any) -> tuple[Any, Any, Any]:
    return 2.0 * t, 1.0, 0.0


@group(name="histories that are wrong")
def histories(v: Variation) -> Answers:
    """Of a load that is no number, of one that fixed steps miss, of a drive whose rate is not its derivative."""

    def pushed(history: Any) -> at.Scene:
        return scene("pushed", [beam("one", A, B)], [at.Clamp("one.start")], [at.Force("one.end", history)])

    missed = at.History(_missed, breaks=[0.0104, 0.0116])
    driven = scene("driven", [beam("one", A, B)], [at.Clamp("one.start", angle=at.History(_false, []))])
    return {
        "not a number, zhai": sound(v.solve, pushed(_broken), mesh=2, **{**ZHAI, "t_end": 0.036}),
        "not a number, generalized-alpha": sound(v.solve, pushed(_broken), mesh=2, **ALPHA),
        "not a number, tolerance": sound(
            lambda: v.solve(pushed(_broken), mesh=2, tolerance=1e-3, t_end=0.05)
        ),
        "between two steps": sound(v.solve, pushed(missed), mesh=2, **ALPHA),
        "false rate": sound(v.solve, driven, mesh=2, **ALPHA),
    }


@group(name="saved, loaded and compared")
def saved(v: Variation) -> Answers:
    """A file gives back every number; errors of two meshes by `compare`."""
    made = scene(
        "saved",
        [beam("one", A, B), beam("two", C, B, FIRM)],
        [at.Clamp("one.start"), at.Pin("one.end", "two.end")],
    )
    coarse, fine = (v.solve(made, mesh=n, **ALPHA) for n in (1, 2))
    with tempfile.TemporaryDirectory() as folder:
        again = at.load(coarse.save(Path(folder) / "run.npz"))
    same = all(
        np.array_equal(getattr(again, read)(place), getattr(coarse, read)(place))
        for read in ("position", "velocity", "angle", "section_force")
        for place in ("one.end", ("two", 0.3))
    )
    frame = again.to_frame(["one.end"]).to_numpy()[:, :2]
    found = at.compare(coarse, fine, ["one.end", "two.start"])
    return {
        "the same": str(same and again.status == coarse.status and np.array_equal(again.t, coarse.t)),
        "error": found.error,
        "largest": found.largest,
        "common outputs": float(found.common),
        "frame less positions": Answer(frame - coarse.position("one.end"), 1.0),
    }
