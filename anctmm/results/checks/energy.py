"""Energy created or lost by numerical error: one check of energies for all solvers that compute them.

The balance of a run is the energy that has appeared since t = 0 without a source: the error of the integrator. It is
compared with all energy that is present or was exchanged. No run may create energy. Numerical dissipation (ρ∞ < 1) may
remove vibrations that loads and drives leave and that the step does not resolve, as intended, but not the motion
itself.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import TIGHT, Discretisation
from anctmm.discretise.methods import Esdirk, GeneralizedAlpha
from anctmm.elements.kinds import kind_of
from anctmm.errors import unknown_kind
from anctmm.model.connectors import Spring
from anctmm.model.joints import drive_of
from anctmm.model.loads import LOADS
from anctmm.model.scene import Force, LineLoad, Load, Scene, Torque
from anctmm.results.checks.acting import drive_rates, length_of, load_sizes, mass_of, reach_of, weight_of
from anctmm.results.checks.finding import Finding, most_stretched, part
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Energy, Solution

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

EPS = float(np.finfo(float).eps)
#: Part of all energy that, come from nowhere, means that a run has diverged. A stable explicit vibration at a part x of
#: the limit of its step shows up to 1/(1 − x²) times its energy: 0.81 from nowhere at x = 0.9.
NOWHERE = 0.85
#: The same of an implicit run, or one of rigid bodies, that is inaccurate: nothing there shows more energy than it has.
#: Of a thousand random runs those of more than 0.1 had errors of 0.1 and more; the base scenes' at the coarsest steps
#: that Newton's iteration bears have 0.03.
INACCURATE = 0.1
#: How many times the energy there ever was may seem to have come from nowhere and gone to dampers and laws, whose work
#: is summed over long times. An explicit run above the limit of its step made 6e5 times it, and a law took that.
ABSORBED = 100.0
#: The same of any run with driven joints, created or lost, of the most that its bodies ever had: errors of the work of
#: damped materials stay below (2e4 of steel that takes 1000 s to relax). Forces of a drive that constraints left
#: undetermined gave 3e7, which damping excused.
IMPOSSIBLE = 1e6
#: Part of the energy that may be exchanged between few outputs, an upper bound, that counts as there then.
UNSEEN = 1e-3
#: Part of the energy exchanged with loads, weight and drives that numerical dissipation may take besides: a load that
#: is applied at once leaves a vibration with half of its work, and bringing that to rest is what dissipation is for. Of
#: 240 random runs one lost more; its errors were 0.09 and, with coarser steps, 0.17.
SETTLED = 0.5
#: Errors of strain that rounding of positions makes in a long run, in units of one rounding.
ROUNDINGS = 1e3
#: Roundings of positions in a step that make speeds.
SHAKEN = 10.0
#: What Newton's iteration may leave of its tolerance.
NEWTON = 0.01
#: Outputs below which they may miss energy exchanged between them.
FEW = 32
#: Spectral radius of generalized-α up to which errors of the forces of constraints die out.
DAMPED = 0.9


def all_energy(energy: Energy) -> Array:
    """All energy present or exchanged at each output, (n,), J."""
    return np.abs(energy.kinetic + energy.strain) + np.abs(energy.potential) + np.abs(energy.work)  # type: ignore[no-any-return]


def from_nowhere(
    energy: Energy, part: float = NOWHERE, least: float = 0.0, *, lost: bool = False, damped: bool = False
) -> Mask:
    """Whether more than a part of all energy until an output, (n,), has come from nowhere there.

    Parameters
    ----------
    energy : Energy
    part : float
    least : float
        All energy is no less than this, J.
    lost : bool
        Whether energy must not vanish either.
    damped : bool
        Whether forces of damping act.
    """
    made = balance_of(energy, damped=damped)
    with np.errstate(invalid="ignore"):
        return (np.abs(made) if lost else made) > part * np.maximum(
            np.maximum.accumulate(all_energy(energy)), least
        )  # type: ignore[no-any-return]


def balance_of(energy: Energy, *, damped: bool) -> Array:
    """Energy from nowhere at each output, (n,), J; with damping the least that it can be.

    What damping takes within the first step of a motion that it stops at once is known badly (the mean force times
    the displacement is many times the energy there was); so no more counts as taken than others have brought. Where a
    solver does not tell what damping takes it is at least what all work has taken together.
    """
    if not damped:
        return energy.balance
    return energy.balance - np.fmax(energy.dissipated, np.maximum(-energy.work, 0.0))  # type: ignore[no-any-return]


def absorbed(energy: Energy, least: float = 0.0) -> Mask:
    """Whether an explicit run makes energy that dampers or laws take as it comes, at each output, (n,).

    What is there stays small then. The first output is left out: a start that damping stops at once is known badly.
    """
    with np.errstate(invalid="ignore"):
        most = np.maximum.accumulate(_present(energy))
        return _since_start(energy) > ABSORBED * np.maximum(most, least)  # type: ignore[no-any-return]


def impossible(energy: Energy, least: float = 0.0) -> Mask:
    """Whether work is wrong at each output, (n,): it is far more than the bodies ever had, and cannot vouch for itself.

    The first output is left out, as of `absorbed`. Strong dampers between bodies may show as much in right runs.
    """
    most = float(np.nanmax(_present(energy), initial=UNSEEN * least))
    with np.errstate(invalid="ignore"):
        return np.abs(_since_start(energy)) > IMPOSSIBLE * most  # type: ignore[no-any-return]


def _present(energy: Energy) -> Array:
    """Energy of bodies, springs and weight at each output, (n,), J."""
    return np.abs(energy.kinetic + energy.strain) + np.abs(energy.potential)  # type: ignore[no-any-return]


def _since_start(energy: Energy) -> Array:
    """Energy that has come from nowhere since the first output, (n,), J."""
    return energy.balance - energy.balance[min(1, len(energy.balance) - 1)]  # type: ignore[no-any-return]


def noise(solution: Solution) -> float:
    """Energy, J, of what rounding and Newton's tolerance leave: a scene at rest has no other.

    Positions of size R are wrong by ε R, or by what is left of the tolerance, and strains by that over the length of
    an element. Loads and weight do work on that.
    """
    run, total = solution.run, 0.0
    length = length_of(solution.scene)
    implicit = run is not None and not run.explicit
    left = NEWTON * run.newton_tolerance * length if run is not None and implicit else 0.0
    if run is not None:
        total += max(ROUNDINGS * EPS, left / length) * _work_of_loads(solution.scene, run)
        speed = SHAKEN * EPS * reach_of(solution.scene) / run.exact_dt
        total += 0.5 * mass_of(solution.scene) * speed**2
    for name, field in solution.fields.items():
        if isinstance(field, HermiteField) and field.coordinates.size:
            body, elements = solution.scene.beam(name), field.coordinates.shape[1] - 1
            reach = float(np.abs(field.coordinates[0, :, 0]).max())
            strain = max(ROUNDINGS * EPS * reach, left) * elements / field.length
            total += 0.5 * body.material.E * body.section.area * field.length * strain**2
    return total


def energy_findings(solution: Solution) -> Iterator[Finding]:
    """What a run's energies say against it."""
    run, energy = solution.run, solution.energy
    if run is None or solution.t.size < 2:
        return
    # upper bounds of what is looked for: nearly always there is none
    much = INACCURATE * np.maximum.accumulate(all_energy(energy))
    if np.count_nonzero(np.abs(energy.balance) > much):
        yield from _from_nowhere(solution, run)
    if np.count_nonzero(energy.dissipated < -much):
        yield from _given_by_damping(solution, run)


def _given_by_damping(solution: Solution, run: Discretisation) -> Iterator[Finding]:
    """Energy that damping, which can only take, has given at some outputs, in fixed steps of generalized-α.

    Their forces of damping are those of velocities that may alternate from step to step. A load that acts at once
    stretched a stiff bar to a hundred times its displacement at rest and back, in balance with the work of its damping.
    A single output may be a start that the step does not resolve. Laws may give energy. With a tolerance what Newton's
    iteration leaves of stiff chains is in this account, and their positions were right.
    """
    energy = solution.energy
    fixed = isinstance(run.method, GeneralizedAlpha) and run.tolerance is None
    if _has_laws(solution.scene) or not fixed:
        return
    present = np.maximum(np.maximum.accumulate(all_energy(energy)), _exchangeable(solution))
    given = -energy.dissipated > np.maximum(INACCURATE * present, noise(solution))
    if np.count_nonzero(given) > 1:
        k = int(np.argmax(np.where(given, -energy.dissipated, 0.0)))
        body, element = most_stretched(solution, k)
        worst = "" if body is None else f", worst in {part(body, element)}"
        yield Finding(
            k,
            "inaccurate",
            f"damping, which can only take energy, has given {-energy.dissipated[k]:.3g} J until {{when}}{worst}: the "
            f"steps do not resolve how it slows the motion down; {_shorter(run)} or integrator='esdirk' may help",
            body,
            element,
        )


def _has_laws(scene: Scene) -> bool:
    """Whether a connector has a law, which may give energy."""
    return any(connector.law is not None for connector in scene.connectors)


def without_given(energy: Energy) -> Energy:
    """The same without energy that damping has given: it can only take.

    Its power in stages is known as badly as Newton's iteration leaves the stretch of stiff beams. What it seems to have
    given and what seems to have vanished is one error then, and none of the motion.
    """
    return replace(energy, work=energy.work - np.fmax(-energy.dissipated, 0.0))


def _shorter(run: Discretisation) -> str:
    """What makes steps shorter."""
    return (
        f"a smaller dt than {run.dt:g} s" if run.tolerance is None else f"a tolerance below {run.tolerance:g}"
    )


def _from_nowhere(solution: Solution, run: Discretisation) -> Iterator[Finding]:
    """Energy that has appeared or vanished by numerical error."""
    energy, explicit, scene = solution.energy, run.explicit, solution.scene
    vibrates = bool(scene.connectors) or any(not kind_of(kind).rigid for _, kind in run.of(scene).values())
    keeps = (run.psi == run.phi == 0.5 and not vibrates) if explicit else _keeps_energy(run)
    dampers = any(c.damping > 0.0 or c.law is not None for c in scene.connectors)
    damped = dampers or any(body.material.damping > 0.0 for body in scene.beams)
    least = _exchangeable(solution)
    known_to = max(noise(solution), _allowed(solution))
    beyond = np.abs(balance_of(energy, damped=damped)) > known_to
    diverged = from_nowhere(energy, NOWHERE, least, damped=damped) & beyond
    if explicit and damped:
        diverged |= absorbed(energy, least) & (np.abs(energy.balance) > noise(solution))
    if diverged.any():
        yield _finding(solution, int(diverged.argmax()), "diverged")
    if not _strong_dampers(solution) and any(drive_of(joint) is not None for joint in scene.joints):
        worthless = impossible(energy, least) & (np.abs(energy.balance) > known_to)
        if worthless.any():
            yield _finding(solution, int(worthless.argmax()), "inaccurate")
    if explicit and vibrates:
        return
    wrong = from_nowhere(energy, INACCURATE, least, lost=keeps and not damped, damped=damped) & beyond
    if not explicit:
        lost = energy if _has_laws(scene) else without_given(energy)
        wrong |= dissipated(lost, least, vibrates=vibrates) & (np.abs(energy.balance) > known_to)
    wrong[:-1] &= wrong[1:]  # what is gone at the next output was a start that the step does not resolve
    if wrong.any():
        yield _finding(solution, int(wrong.argmax()), "inaccurate")


def _strong_dampers(solution: Solution) -> bool:
    """Whether a damper, or a law, may stop all bodies between two outputs: errors of its work are large then.

    The work of a damper c on a mass m was wrong by up to (c dt/m)² times the energy.
    """
    scene = solution.scene
    span, mass = float(np.diff(solution.t).max()), mass_of(scene)
    arms = (1.0 if isinstance(c, Spring) else length_of(scene) for c in scene.connectors)
    return any(
        c.law is not None or c.damping * span > mass * arm**2
        for c, arm in zip(scene.connectors, arms, strict=True)
    )


def _allowed(solution: Solution) -> float:
    """Energy, J, by which a run with a tolerance may be wrong: that part of the largest there ever was.

    A motion that has just begun has little energy, and all of it may be wrong by then.
    """
    present = all_energy(solution.energy)
    known = present[np.isfinite(present)]
    tolerance = solution.run.tolerance if solution.run is not None else None
    return float(tolerance * known.max()) if tolerance is not None and known.size else 0.0


def dissipated(energy: Energy, least: float = 0.0, *, vibrates: bool = True) -> Mask:
    """Whether more energy until an output, (n,), has vanished there than damping and vibrations after loads explain.

    What damping takes within a step is known badly, but it is counted too large: this sees less then, not more.

    Parameters
    ----------
    energy : Energy
    least : float
        All energy, and that exchanged with loads, weight and drives, are no less than this, J.
    vibrates : bool
        Whether anything can: rigid bodies alone have no vibration that loads leave.
    """
    settled = SETTLED if vibrates else 0.0
    with np.errstate(invalid="ignore"):
        present, exchanged = (
            np.maximum(np.maximum.accumulate(e), least)
            for e in (all_energy(energy), np.abs(energy.potential) + np.abs(energy.work))
        )
        return -energy.balance > INACCURATE * present + settled * exchanged  # type: ignore[no-any-return]


def _finding(solution: Solution, k: int, code: str) -> Finding:
    run, energy = solution.run, solution.energy
    assert run is not None
    body, element = most_stretched(solution, k)
    worst = "" if body is None else f", worst in {part(body, element)}"
    balance, present = float(energy.balance[k]), float(all_energy(energy)[: k + 1].max())
    share = "nearly all energy" if code == "diverged" else "much of the energy"
    verb = "was created by numerical error" if balance > 0.0 else "vanished"
    advice = _advice(run) if balance > 0.0 or run.explicit else _advice_on_dissipation(run)
    return Finding(
        k,
        code,
        f"{share} at {{when}} {verb} ({abs(balance):.3g} J of {present:.3g} J){worst}: {advice}",
        body,
        element,
    )


def _advice(run: Discretisation) -> str:
    """Why energy may come from nowhere, and what to try."""
    if run.explicit:
        return (
            f"an explicit step is above the stability limit, which deformation lowers, or too long for the motion; "
            f"a smaller dt than {run.dt:g} s may help"
        )
    if run.tolerance is not None:
        other = "" if isinstance(run.method, Esdirk) else ", integrator='esdirk'"
        smaller = f"a tolerance below {run.tolerance:g}{other} or a fixed dt"
        return f"the steps are too long for the motion; {smaller} may help"
    smaller = f"a smaller dt than {run.dt:g} s{_tighter(run)} may help"
    if isinstance(run.method, GeneralizedAlpha) and run.spectral_radius > DAMPED:
        return (
            f"the steps are too long for the motion, or, with a spectral_radius of {run.spectral_radius:g}, errors of "
            f"the forces of joints and rigid bodies have grown, as nothing damps them; {smaller}, or a spectral_radius "
            f"of {DAMPED:g} or less"
        )
    return f"the steps are too long for the motion; {smaller}"


def _tighter(run: Discretisation) -> str:
    """What to try beside where Newton's iteration leaves more than by default."""
    loose = run.newton_tolerance > TIGHT
    return f" or a newton_tolerance below {run.newton_tolerance:g}" if loose else ""


def _keeps_energy(run: Discretisation) -> bool:
    """Whether implicit steps have no numerical dissipation."""
    return isinstance(run.method, GeneralizedAlpha) and run.spectral_radius == 1.0


def _advice_on_dissipation(run: Discretisation) -> str:
    """Why energy may vanish, and what to try."""
    controlled = run.tolerance is not None
    smaller = _shorter(run)
    if not isinstance(run.method, GeneralizedAlpha):
        return f"the method removes motions that the steps do not resolve; {smaller} may help"
    if _keeps_energy(run):
        return _advice(run)
    taken = f"numerical dissipation (spectral_radius {run.spectral_radius:g}) removes what the steps do not resolve"
    other = ", integrator='esdirk'" if controlled else ""
    return f"{taken}; {smaller}{other} or a larger spectral_radius may help"


def _exchangeable(solution: Solution) -> float:
    """Energy, J, that drives, loads, connectors and weight may exchange between outputs that are few; 0 where many.

    A crank that has come back to where it was, at rest, shows nothing of the energy that it had on its way. What a
    spring takes and gives back while nothing is driven is there at outputs, too, or comes from loads and weight.
    """
    scene, run = solution.scene, solution.run
    if run is None or solution.t.size >= FEW:
        return 0.0
    span = length_of(scene)
    turning = sum(0.5 * mass_of(scene) * (span * rate) ** 2 for rate in drive_rates(scene, run))
    springs, driven = 0.0, _driven(scene)
    for connector in scene.connectors:
        way = span if isinstance(connector, Spring) else 2.0 * np.pi
        springs += 0.5 * connector.stiffness * way**2 * driven + abs(connector.preload) * way
    return turning + _work_of_loads(scene, run) + springs


def _driven(scene: Scene) -> bool:
    """Whether a joint or a connector is driven."""
    free = (c.length if isinstance(c, Spring) else c.angle for c in scene.connectors)
    return any(drive_of(joint) is not None for joint in scene.joints) or any(map(callable, free))


def _work_of_loads(scene: Scene, run: Discretisation) -> float:
    """Work, J, that weight and loads may do."""
    loads = sum(size * _reach(scene, load) for load, size in load_sizes(scene, run))
    return weight_of(scene) * length_of(scene) + loads


def _reach(scene: Scene, load: Load) -> float:
    """How far a load may act: m, or rad."""
    match load:
        case Force() | LineLoad():
            return length_of(scene)
        case Torque():
            return 2.0 * np.pi
        case _:
            raise unknown_kind("load", load, LOADS)
