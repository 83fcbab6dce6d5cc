"""Runs the rules on a registered solver and shows the findings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd
from rich.console import Console

from anctmm.errors import PluginError
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.conformance.rules import RULES, SIGNATURE, BrokenRule, Rule, Subject
from studies.conformance.scenes import cantilever
from studies.engine.tables import say_counts, show_frame
from studies.engine.trials import not_installed

HOLDS, BROKEN, NOT_OFFERED = "holds", "broken", "not offered"
NOT_RUN, NOT_INSTALLED = "not run", "not installed"


@dataclass(frozen=True)
class Finding:
    """A row of the table."""

    rule: str
    asks: str
    measured: str
    allowed: str
    verdict: str


def conform(name: str) -> Iterator[Finding]:
    """Test a registered solver against every rule, a finding at a time; UnknownSolverError if none has that name."""
    asks = "it can be imported"
    try:
        subject = Subject(name, registry.load(name))
        lacks = ", ".join(sorted(subject.offer.lacks)) or "nothing"
    except PluginError as error:
        yield Finding("loads", asks, str(error), "", BROKEN)
        return
    yield Finding("loads", asks, f"lacks {lacks}", "", HOLDS)
    if absent := _missing(subject):
        yield Finding("installed", "the packages it needs are installed", absent, "", NOT_INSTALLED)
    called = not absent
    for rule in RULES:
        found = judge(rule, subject) if called else Finding(rule.name, rule.asks, "", "", NOT_RUN)
        called = called and (rule.name, found.verdict) != (SIGNATURE, BROKEN)
        yield found


def _missing(subject: Subject) -> str:
    """What a solver says is not installed; empty if it says no such thing."""
    try:
        status = subject.solve(cantilever(), subject.run(t_end=0.02)).status
    except Exception:  # whatever a broken solver does is for the rules to find
        return ""
    return status.message if isinstance(status, Status) and not_installed(status) else ""


def judge(rule: Rule, subject: Subject) -> Finding:
    """One rule's finding; whatever is raised on the way breaks the rule."""
    measured, allowed, verdict = "", "", BROKEN
    try:
        if lacking := subject.offer.lacking(rule.needs):
            measured, verdict = f"lacks {', '.join(lacking)}", NOT_OFFERED
        elif isinstance(found := rule.test(subject), str):
            measured, verdict = found, HOLDS
        else:
            measured, allowed = f"{found[0]:.2g} {found[2]}", f"{found[1]:.2g}"
            verdict = HOLDS if found[0] <= found[1] else BROKEN  # what is no number is not
    except BrokenRule as reason:
        measured = str(reason)
    except Exception as error:  # a broken solver may raise anything
        measured = f"{type(error).__name__}: {' '.join(str(error).split())}"
    return Finding(rule.name, rule.asks, measured, allowed, verdict)


def exit_code(findings: Sequence[Finding]) -> int:
    """0 if all rules hold, 1 if one is broken, 4 if none could be tested: what the solver needs is not installed."""
    verdicts = {f.verdict for f in findings}
    return 4 if NOT_INSTALLED in verdicts else 0 if verdicts <= {HOLDS, NOT_OFFERED} else 1


def show(name: str, findings: Sequence[Finding], console: Console) -> None:
    """Print the table and the count of each verdict."""
    show_frame(console, f"Solver {name}", pd.DataFrame(findings))
    say_counts(console, (f.verdict for f in findings))
