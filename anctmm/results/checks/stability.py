"""The status of an equilibrium that is not stable, in the same words for all solvers."""

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.model.scene import Scene
from anctmm.results.checks.finding import part
from anctmm.results.status import Status

SMALLER = "anctmm.solve_static(..., branch='stable') finds a stable one, smaller load steps may"


def unstable(
    factor: float,
    negative: int,
    body: str | None,
    element: int | None,
    stable_until: float,
    advice: str = "",
    flutter: bool = False,
) -> Status:
    """Status of an unstable equilibrium, with so many negative eigenvalues of the tangent stiffness.

    Body and element are those that move most as the energy falls; `stable_until` is the last load factor with a stable
    equilibrium, or 0; `advice` says how one can be found; with `flutter` oscillations grow.
    """
    count = "1 negative eigenvalue" if negative == 1 else f"{negative} negative eigenvalues"
    why = "small oscillations grow (flutter)" if flutter else f"the tangent stiffness has {count}"
    before = f"; at {stable_until:.6g} it was stable" if stable_until > 0.0 else ""
    return Status(
        "unstable",
        f"the equilibrium at load factor {factor:.6g} is unstable: {why}"
        f"{_where(body, element)}{before}; {advice or SMALLER}",
        time=factor,
        body=body,
        element=element,
    )


def singular(factor: float, body: str | None, element: int | None, unlike: str = "") -> Status:
    """Status of an equilibrium at which a motion needs no force, as of `unstable`, with what `unlike_bodies` says."""
    return Status(
        "singular",
        f"the tangent stiffness at load factor {factor:.6g} is singular{_where(body, element)}: the scene is a "
        f"mechanism, free to move, or at the limit of stability, and its equilibrium is one of many; hold the scene, "
        f"or change the load a little{unlike}",
        time=factor,
        body=body,
        element=element,
    )


def unlike_bodies(scene: Scene, run: Discretisation) -> str:
    """Another reason of a singular tangent, or none: bodies so unlike in stiffness that rounding hides the softest."""
    cut = run.of(scene)
    bending = {
        beam.name: beam.material.E * beam.section.second_moment / beam.length**3
        for beam in scene.beams
        if not kind_of(cut[beam.name][1]).rigid
    }
    if not bending or (ratio := max(bending.values()) / min(bending.values())) < 1e6:
        return ""
    stiff, soft = max(bending, key=bending.__getitem__), min(bending, key=bending.__getitem__)
    return (
        f"; or rounding hides its stiffness, as body {stiff!r} is {ratio:.1g} times stiffer than {soft!r}: a rigid "
        f"body in its place may help"
    )


def _where(body: str | None, element: int | None) -> str:
    return "" if body is None else f", most in {part(body, element)}"
