"""Runs the rules on a registered solver and shows the findings."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd
from rich.console import Console

from anctmm.errors import PluginError
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.conformance.rules import RULES, SIGNATURE, Rule
from studies.conformance.scenes import cantilever
from studies.conformance.subject import BrokenRule, Subject
from studies.engine.tables import say, show_frame

LOADS = Rule("loads", "it can be imported")
INSTALLED = Rule("installed", "the packages it needs are installed")
HOLDS, BROKEN, NOT_OFFERED, NOT_RUN = "holds", "broken", "not offered", "not run"
NOT_INSTALLED = "not installed"
VERDICTS = (HOLDS, BROKEN, NOT_OFFERED, NOT_RUN, NOT_INSTALLED)


@dataclass(frozen=True)
class Finding:
    """A row of the table."""

    rule: str
    asks: str
    measured: str
    allowed: str
    verdict: str


def conform(name: str) -> Iterator[Finding]:
    """Test a registered solver against every rule, a finding at a time.

    Raises
    ------
    UnknownSolverError
        If no package registers that name.
    """
    try:
        subject = Subject(name, registry.load(name))
        lacks = ", ".join(sorted(subject.offer.lacks)) or "nothing"
    except PluginError as error:
        yield _finding(LOADS, BROKEN, str(error))
        return
    yield _finding(LOADS, HOLDS, f"lacks {lacks}")
    called = True
    if absent := _missing(subject):
        yield _finding(INSTALLED, NOT_INSTALLED, absent)
        called = False
    for rule in RULES:
        found = judge(rule, subject) if called else _finding(rule, NOT_RUN)
        called = called and (rule.name, found.verdict) != (SIGNATURE, BROKEN)
        yield found


def _finding(rule: Rule, verdict: str, measured: str = "", allowed: str = "") -> Finding:
    return Finding(rule.name, rule.asks, measured, allowed, verdict)


def _missing(subject: Subject) -> str:
    """What a solver says is not installed; empty if it says no such thing."""
    try:
        status = subject.solve(cantilever(), subject.run(t_end=0.02)).status
    except Exception:  # whatever a broken solver does is for the rules to find
        return ""
    absent = isinstance(status, Status) and status.code == "unsupported" and "not installed" in status.message
    return status.message if absent else ""


def judge(rule: Rule, subject: Subject) -> Finding:
    """One rule's finding; whatever is raised on the way breaks the rule."""
    if lacking := subject.offer.lacking(rule.needs):
        return _finding(rule, NOT_OFFERED, f"lacks {', '.join(lacking)}")
    try:
        found = rule.test(subject)
    except BrokenRule as reason:
        return _finding(rule, BROKEN, str(reason))
    except Exception as error:  # a broken solver may raise anything
        return _finding(rule, BROKEN, f"{type(error).__name__}: {' '.join(str(error).split())}")
    if isinstance(found, str):
        return _finding(rule, HOLDS, found)
    value, allowed, what = found
    verdict = HOLDS if value <= allowed else BROKEN  # what is no number is not
    return _finding(rule, verdict, f"{value:.2g} {what}", f"{allowed:.2g}")


def exit_code(findings: Sequence[Finding]) -> int:
    """0 if all rules hold, 1 if one is broken, 4 if none could be tested: what the solver needs is not installed."""
    verdicts = {f.verdict for f in findings}
    return 4 if NOT_INSTALLED in verdicts else 0 if verdicts <= {HOLDS, NOT_OFFERED} else 1


def show(name: str, findings: Sequence[Finding], console: Console) -> None:
    """Print the table and the count of each verdict."""
    columns = ["rule", "asks", "measured", "allowed", "verdict"]
    lines = [[getattr(f, column) for column in columns] for f in findings]
    show_frame(console, f"Solver {name}", pd.DataFrame(lines, columns=columns))
    counts = Counter(f.verdict for f in findings)
    say(console, ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict]))
