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
from anctmm.results.checks.finding import Finding, most_stretched
from anctmm.results.checks.scales import EPS, drive_rates, is_driven, mass_of, reach_of, work_of_loads
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Energy, Solution

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Part of all energy that, come from nowhere, means that a run has diverged. A stable explicit vibration at a part x of
#: the limit of its step shows up to 1/(1 − x²) times its energy: 0.81 from nowhere at x = 0.9.
NOWHERE = 0.85
#: The same of an implicit run, or one of rigid bodies, that is inaccurate: nothing there shows more energy than it has.
INACCURATE = 0.1
#: How many times the energy there ever was may seem to have come from nowhere and gone to dampers and laws, whose work
#: is summed over long times, in an explicit run.
ABSORBED = 100.0
#: Part of the energy exchanged with loads, weight and drives that numerical dissipation may take besides: a load that
#: is applied at once leaves a vibration with half of its work, and bringing that to rest is what dissipation is for.
SETTLED = 0.5
#: Errors of strain that rounding of positions makes in a long run, and roundings of positions in a step that make
#: speeds, in units of one rounding; what Newton's iteration may leave of its tolerance.
STRAINS, SPEEDS, NEWTON = 1e3, 10.0, 0.01
#: Outputs below which they may miss energy exchanged between them.
FEW = 32


def energy_findings(solution: Solution) -> Iterator[Finding]:
    """What a run's energies say against it."""
    run, energy = solution.run, solution.energy
    if run is None or solution.t.size < 2:
        return
    with np.errstate(invalid="ignore"):
        much = INACCURATE * np.maximum.accumulate(all_energy(energy))
        if (np.abs(energy.balance) > much).any() or (energy.dissipated < -much).any():  # nearly never
            yield from _Account(solution, run).findings()


def all_energy(energy: Energy) -> Array:
    """All energy present or exchanged at each output, (n,), J."""
    return _stored(energy) + np.abs(energy.work)  # type: ignore[no-any-return]


def _stored(energy: Energy) -> Array:
    """Energy of bodies, springs and weight at each output, (n,), J."""
    return np.abs(energy.kinetic + energy.strain) + np.abs(energy.potential)  # type: ignore[no-any-return]


class _Account:
    """Where the energy of a run has come from and gone to.

    What damping takes within the first step of a motion that it stops at once is known badly: the mean force times the
    displacement is many times the energy there was. So no more counts as taken than others have brought.
    """

    def __init__(self, solution: Solution, run: Discretisation) -> None:
        scene = solution.scene
        self.solution, self.run, self.energy = solution, run, solution.energy
        self.laws = any(c.law is not None for c in scene.connectors)
        dampers = self.laws or any(c.damping > 0.0 for c in scene.connectors)
        self.damped = dampers or any(body.material.damping > 0.0 for body in scene.beams)
        bend = any(not kind_of(kind).rigid for _, kind in run.of(scene).values())
        #: Whether anything can vibrate.
        self.vibrates = bool(scene.connectors) or bend
        self.few = _exchangeable(solution, run)
        self.noise = max(noise(solution, run), _allowed(solution, run))

    def findings(self) -> Iterator[Finding]:
        """What is wrong, the worst first."""
        with np.errstate(invalid="ignore"):
            for code, wrong in (("diverged", self._diverged()), ("inaccurate", self._inaccurate())):
                if wrong.any():
                    k = int(wrong.argmax())
                    balance, present = float(self.energy.balance[k]), all_energy(self.energy)[: k + 1].max()
                    verb = "was created by numerical error" if balance > 0.0 else "vanished"
                    share = "nearly all energy" if code == "diverged" else "much of the energy"
                    sizes = f"({abs(balance):.3g} J of {present:.3g} J)"
                    advice = _advice(self.run, balance > 0.0)
                    yield self._finding(k, code, f"{share} at {{when}} {verb} {sizes}", advice)
            if (given := self._given()).sum() > 1:
                k = int(np.where(given, -self.energy.dissipated, 0.0).argmax())
                given_energy = f"{-self.energy.dissipated[k]:.3g} J"
                what = f"damping, which can only take energy, has given {given_energy} until {{when}}"
                yield self._finding(k, "inaccurate", what, _advice(self.run, True))

    def _finding(self, k: int, code: str, what: str, advice: str) -> Finding:
        body, element, worst = most_stretched(self.solution, k)
        return Finding(k, code, f"{what}{worst}: {advice}", body, element)

    def _most(self, series: Array) -> Array:
        """The largest value until each output, and at least what may have been exchanged between few of them."""
        return np.maximum(np.maximum.accumulate(series), self.few)

    @property
    def _made(self) -> Array:
        """Energy from nowhere at each output, (n,), J; with damping the least that it can be."""
        energy = self.energy
        taken = np.fmax(energy.dissipated, np.maximum(-energy.work, 0.0)) if self.damped else 0.0
        return energy.balance - taken  # type: ignore[no-any-return]

    def _diverged(self) -> Mask:
        made, balance = self._made, self.energy.balance
        found = (made > NOWHERE * self._most(all_energy(self.energy))) & (made > self.noise)
        if self.run.explicit and self.damped:  # without the start, which damping stops at once
            since = balance - balance[1]
            found |= (since > ABSORBED * self._most(_stored(self.energy))) & (np.abs(balance) > self.noise)
        return found  # type: ignore[no-any-return]

    def _inaccurate(self) -> Mask:
        run, energy, made = self.run, self.energy, self._made
        if run.explicit and self.vibrates:
            return np.zeros(len(made), dtype=bool)
        exact = run.psi == run.phi == 0.5 if run.explicit else _keeps_energy(run)
        size = np.abs(made) if exact and not self.damped else made
        found = (size > INACCURATE * self._most(all_energy(energy))) & (np.abs(made) > self.noise)
        if not run.explicit:
            # damping can only take: what it seems to have given and what seems to have vanished is one error
            given = 0.0 if self.laws else np.fmax(-energy.dissipated, 0.0)
            work = np.abs(energy.work - given)
            limit = INACCURATE * self._most(_stored(energy) + work)
            if self.vibrates:
                limit = limit + SETTLED * self._most(np.abs(energy.potential) + work)
            found |= (-energy.balance - given > limit) & (np.abs(energy.balance) > self.noise)
        found[:-1] &= found[1:]  # what is gone at the next output was a start that the step does not resolve
        return found  # type: ignore[no-any-return]

    def _given(self) -> Mask:
        """Outputs until which damping, which can only take, has given energy, in fixed steps of generalized-α.

        Their forces of damping are those of velocities that may alternate from step to step.
        """
        fixed = isinstance(self.run.method, GeneralizedAlpha) and self.run.tolerance is None
        limit = np.maximum(INACCURATE * self._most(all_energy(self.energy)), self.noise)
        return (-self.energy.dissipated > limit) & (fixed and not self.laws)  # type: ignore[no-any-return]


def noise(solution: Solution, run: Discretisation) -> float:
    """Energy, J, of what rounding and Newton's tolerance leave: a scene at rest has no other.

    Positions of size R are wrong by ε R, or by what is left of the tolerance, and strains by that over the length of
    an element. Loads and weight do work on that.
    """
    scene = solution.scene
    left = 0.0 if run.explicit else NEWTON * run.newton_tolerance * scene.length
    speed = SPEEDS * EPS * reach_of(scene) / run.exact_dt
    total = max(STRAINS * EPS, left / scene.length) * work_of_loads(scene, run)
    total += 0.5 * mass_of(scene) * speed**2
    for name, field in solution.fields.items():
        if isinstance(field, HermiteField) and field.coordinates.size:
            body, elements = scene.beam(name), field.coordinates.shape[1] - 1
            reach = float(np.abs(field.coordinates[0, :, 0]).max())
            strain = max(STRAINS * EPS * reach, left) * elements / field.length
            total += 0.5 * body.material.E * body.section.area * field.length * strain**2
    return total


def _allowed(solution: Solution, run: Discretisation) -> float:
    """Energy, J, by which a run with a tolerance may be wrong: that part of the largest there ever was.

    A motion that has just begun has little energy, and all of it may be wrong by then.
    """
    present = all_energy(solution.energy)
    most = float(present[np.isfinite(present)].max(initial=0.0))
    return 0.0 if run.tolerance is None else run.tolerance * most


def _exchangeable(solution: Solution, run: Discretisation) -> float:
    """Energy, J, that drives, loads, connectors and weight may exchange between outputs that are few; 0 where many.

    A crank that has come back to where it was, at rest, shows nothing of the energy that it had on its way. What a
    spring takes and gives back while nothing is driven is there at outputs, too, or comes from loads and weight.
    """
    scene = solution.scene
    if solution.t.size >= FEW:
        return 0.0
    total = work_of_loads(scene, run)
    total += sum(0.5 * mass_of(scene) * (scene.length * rate) ** 2 for rate in drive_rates(scene, run))
    for connector in scene.connectors:
        way = scene.length if isinstance(connector, Spring) else 2.0 * np.pi
        total += 0.5 * connector.stiffness * way**2 * is_driven(scene) + abs(connector.preload) * way
    return total


def _keeps_energy(run: Discretisation) -> bool:
    """Whether implicit steps have no numerical dissipation."""
    return isinstance(run.method, GeneralizedAlpha) and run.spectral_radius == 1.0


def _advice(run: Discretisation, created: bool) -> str:
    """Why energy may come from nowhere, or vanish, and what to try."""
    smaller = (
        f"smaller dt than {run.dt:g} s" if run.tolerance is None else f"tolerance below {run.tolerance:g}"
    )
    why, other = "the steps are too long for the motion", ""
    if run.explicit:
        why = f"an explicit step is above the stability limit, which deformation lowers, or {why}"
    elif not created and not _keeps_energy(run):
        why = "numerical dissipation removes what the steps do not resolve"
        other = " or a larger spectral_radius" if isinstance(run.method, GeneralizedAlpha) else ""
    elif isinstance(run.method, GeneralizedAlpha):
        other = ", a spectral_radius of 0.9 or less, or integrator='esdirk'"
    return f"{why}; a {smaller}{other} may help"
