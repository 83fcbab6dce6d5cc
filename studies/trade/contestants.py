"""The solvers whose times are compared: those that solve a scene by code made for speed."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from anctmm.model.case import Case
from anctmm.model.needs import needs
from anctmm.solvers import registry
from studies.engine.accuracy.dynamics import Plan


def left_out(plan: Plan, case: Case, asked: Iterable[str] | None) -> dict[str, list[str]]:
    """Solvers of a plan that are slow with features of a case, with these features; without the requested solvers."""
    listed = dict.fromkeys(solver for scheme in plan.schemes for solver in scheme.solvers)
    slow = {solver: _slow_with(solver, case) for solver in listed if solver not in (asked or ())}
    return {solver: things for solver, things in slow.items() if things}


def without(plan: Plan, solvers: Iterable[str]) -> Plan:
    """A plan without some solvers, and without what they alone run."""
    gone = set(solvers)
    schemes = (replace(s, solvers=tuple(x for x in s.solvers if x not in gone)) for s in plan.schemes)
    return replace(plan, schemes=tuple(s for s in schemes if s.solvers))


def said_of(case: Case, out: Mapping[str, list[str]]) -> list[str]:
    """Sentences about who is left out, and why."""
    return [
        f"{case.name}: {solver} is not timed: it has {', '.join(things)} to check answers, and is not made to be fast "
        f"with them; --solvers {solver} times it all the same."
        for solver, things in out.items()
    ]


def _slow_with(solver: str, case: Case) -> list[str]:
    slow = registry.offer_of(registry.load(solver)).slow_with
    return [f.replace("-", " ") for f in dict.fromkeys(f for f, _ in needs(case.scene)) if f in slow]
