"""Energy created or lost by numerical error: one check of energies for all solvers that compute them.

The balance of a run is the energy that has appeared since t = 0 without a source: the error of the integrator. It is
compared with all energy that is present or was exchanged. No run may create energy. Numerical dissipation (ρ∞ < 1) may
remove vibrations that loads and drives leave and that the step does not resolve, as intended, but not the motion
itself.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.methods import GeneralizedAlpha
from anctmm.elements.kinds import kind_of
from anctmm.model.connectors import Spring
from anctmm.model.scene import Scene
from anctmm.results.checks.finding import Finding, most_stretched
from anctmm.results.checks.scales import drive_rates, is_driven, mass_of, reach_of, work_of_loads
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Energy, Solution
from anctmm.validation import EPS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Part of all energy that, come from nowhere, means that a run has diverged. A stable explicit vibration at a part x of
#: the limit of its step shows up to 1/(1 − x²) times its energy: 0.81 from nowhere at x = 0.9.
NOWHERE = 0.85
#: The same of an implicit run, or one of rigid bodies, that is inaccurate: nothing there shows more energy than it has.
INACCURATE = 0.1
#: Part of the energy exchanged with loads, weight and drives that numerical dissipation may take besides: a load that
#: is applied at once leaves a vibration with half of its work, and bringing that to rest is what dissipation is for.
SETTLED = 0.5
#: How many times the energy there ever was may seem to have come from nowhere and gone to dampers and laws, whose work
#: is summed over long times, in an explicit run.
ABSORBED = 100.0
#: Outputs below which they may miss energy exchanged between them.
FEW = 32


def energy_findings(solution: Solution) -> Iterator[Finding]:
    """The first output at which energy has come from nowhere, or vanished."""
    run, energy = solution.run, solution.energy
    if run is None or solution.t.size < 2:
        return
    with np.errstate(invalid="ignore"):
        present = _stored(energy) + np.abs(energy.work)
        if not (np.abs(energy.balance) > INACCURATE * np.maximum.accumulate(present)).any():
            return  # nearly always: what follows looks at all loads and drives
        for code, wrong in _wrong(solution, run):
            if wrong.any():
                k = int(wrong.argmax())
                error = float(energy.balance[k])
                verb = "was created by numerical error" if error > 0.0 else "vanished"
                sizes = f"{abs(error):.3g} J of {present[: k + 1].max():.3g} J {verb} until {{when}}"
                message = f"{sizes}: {_advice(run)}"
                yield Finding(k, code, message, *most_stretched(solution, k))


def _stored(energy: Energy) -> Array:
    """Energy of bodies, springs and weight at each output, (n,), J."""
    return np.abs(energy.kinetic + energy.strain) + np.abs(energy.potential)  # type: ignore[no-any-return]


def _wrong(solution: Solution, run: Discretisation) -> Iterator[tuple[str, Mask]]:
    """Outputs at which the energy is wrong, by the code of the status."""
    scene, energy = solution.scene, solution.energy
    few = _exchangeable(scene, run) if solution.t.size < FEW else 0.0

    def most(series: Array) -> Array:
        return np.maximum(np.maximum.accumulate(series), few)

    balance, stored = energy.balance, _stored(energy)
    exchanged = np.abs(energy.potential) + np.abs(energy.work)
    damped = any(c.law is not None or c.damping > 0.0 for c in scene.connectors)
    damped |= any(beam.material.damping > 0.0 for beam in scene.beams)
    # Within the first step of a motion that damping stops at once, the mean force times the displacement is many times
    # the energy there was: what is taken counts neither as made nor as present.
    taken = np.fmax(energy.dissipated, np.maximum(-energy.work, 0.0)) if damped else 0.0
    made, present = balance - taken, most(stored + np.abs(energy.work + taken))
    diverged = made > NOWHERE * present
    if run.explicit and damped:
        diverged |= balance - balance[1] > ABSORBED * most(stored)
    significant = np.abs(balance) > _noise(solution, run)
    yield "diverged", diverged & significant

    vibrates = bool(scene.connectors) or any(not kind_of(kind).rigid for _, kind in run.of(scene).values())
    if run.explicit and vibrates:
        return
    inaccurate = made > INACCURATE * present
    if not run.explicit or not damped:
        settles = vibrates and (damped or not _keeps_energy(run))
        inaccurate |= -balance > INACCURATE * present + (SETTLED * most(exchanged) if settles else 0.0)
    # what is gone at the next output was a start that the step does not resolve
    inaccurate[:-1] &= inaccurate[1:]
    yield "inaccurate", inaccurate & significant


def _noise(solution: Solution, run: Discretisation) -> float:
    """Energy, J, of what rounding and Newton's tolerance leave, and of what a tolerance allows.

    Positions are wrong by so much, strains by that over the length of an element, speeds by that over a step; loads and
    weight do work on it.
    """
    scene, energy = solution.scene, solution.energy
    error = 1e3 * EPS * reach_of(scene)
    left = 0.0 if run.explicit else 0.01 * run.newton_tolerance * scene.length
    strain = max(1e3 * EPS, left / scene.length)
    total = strain * work_of_loads(scene, run) + 0.5 * mass_of(scene) * (0.01 * error / run.exact_dt) ** 2
    for name, field in solution.fields.items():
        if isinstance(field, HermiteField):
            body, elements = scene.beam(name), field.coordinates.shape[1] - 1
            strain = max(error, left) * elements / field.length
            total += 0.5 * body.material.E * body.section.area * field.length * strain**2
    if run.tolerance is not None:
        sizes = _stored(energy) + np.abs(energy.work)
        total = max(total, run.tolerance * float(sizes[np.isfinite(sizes)].max(initial=0.0)))
    return total


def _exchangeable(scene: Scene, run: Discretisation) -> float:
    """Energy, J, that drives, loads, connectors and weight may exchange between outputs.

    A crank that has come back to where it was, at rest, shows nothing of the energy that it had on its way. What a
    spring takes and gives back while nothing is driven is there at outputs, too, or comes from loads and weight.
    """
    total = work_of_loads(scene, run)
    total += sum(0.5 * mass_of(scene) * (scene.length * rate) ** 2 for rate in drive_rates(scene, run))
    for connector in scene.connectors:
        way = scene.length if isinstance(connector, Spring) else 2.0 * np.pi
        total += 0.5 * connector.stiffness * way**2 * is_driven(scene) + abs(connector.preload) * way
    return total


def _keeps_energy(run: Discretisation) -> bool:
    """Whether steps have no numerical dissipation."""
    if run.explicit:
        return run.psi == run.phi == 0.5
    return isinstance(run.method, GeneralizedAlpha) and run.spectral_radius == 1.0


def _advice(run: Discretisation) -> str:
    """Why energy may come from nowhere, or vanish, and what to try."""
    why = "above the stability limit, or too long" if run.explicit else "too long"
    smaller = f"dt than {run.dt:g} s" if run.tolerance is None else f"tolerance than {run.tolerance:g}"
    return f"steps are {why} for the motion; a smaller {smaller} or integrator='esdirk' may help"
