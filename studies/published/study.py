"""Published numbers as a table, and whether the solvers here find them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import floor, log10
from typing import Any

import pandas as pd

from anctmm.errors import AnctmmError
from reference.exact.andrews import PUBLISHED as SQUEEZED
from studies.published import problems as p
from studies.published.problems import Value

#: What a digitised curve or a single run of another code may be off by, of the number.
DIGITISED = 0.02
#: Digits from which on two numbers are the same except for the last ones; and those of a double.
FEW, ALL = 3, 15
EXUDYN = "Exudyn, test models"
NACHBAGAUER = "Nachbagauer et al. 2011, 10.1007/s11044-011-9249-8"
WRIGHT = "Wright et al. 1982, J. Appl. Mech. 49, 197–202"
SIMO = "Simo & Vu-Quoc 1986, J. Appl. Mech. 53, 855–863"
IVP = "Test Set for Initial Value Problem Solvers, tolerance 1e-14"
LAG = "from the lag frequency, which is what a planar code finds"
SHEAR = "needs Reissner's beam: the paper's shear element has Green's strains and locks for ν > 0"
COARSE = "on the published mesh of linear elements of Exudyn's beam of Reissner's kind"


@dataclass(frozen=True)
class Published:
    """One number of a published problem.

    Parameters
    ----------
    problem, quantity, unit : str
    printed : str
        As printed; its uncertainty is half of its last digit, unless `kind` says otherwise.
    find : callable
        Whether the run is quick → Value; None where the problem cannot be put to the solvers here.
    source, note : str
    kind : str
        "printed"; "exact": a formula, each digit of which is known; "curve": read off a curve.
    """

    problem: str
    quantity: str
    unit: str
    printed: str
    find: Callable[[bool], Value] | None
    source: str
    note: str = ""
    kind: str = "printed"

    @property
    def value(self) -> float:
        """The number."""
        return float(self.printed)

    @property
    def uncertainty(self) -> float:
        """Of the number: half of its last digit, or what reading a curve may be off by."""
        if self.kind != "printed":
            return {"exact": 1e-15, "curve": DIGITISED}[self.kind] * abs(self.value)
        mantissa, _, power = self.printed.lower().partition("e")
        return float(0.5 * 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2])))


def _row(
    problem: str, quantity: str, unit: str, printed: Any, find: Any, source: str, *more: str
) -> Published:
    return Published(problem, quantity, unit, str(printed), find, source, *more)


PUBLISHED = (
    *(
        _row("elastica, F L²/EI = 3", f"tip displacement {name}", "m", printed, partial(p.elastica, axis=k), EXUDYN,
             "the value of a finite mesh of cables, as its source says, not of the limit")
        for k, (name, printed) in enumerate([("x", "-0.508537304326"), ("y", "-1.207239854550")])
    ),
    *(
        _row("elastica, 4 cables", f"tip displacement {name}", "m", printed, partial(p.four_cables, axis=k), EXUDYN,
             "on the same mesh, with its clamp, which leaves the stretch free")
        for k, (name, printed) in enumerate([("x", "-0.50742872"), ("y", "-1.20553370")])
    ),
    _row("roll-up, M L/EI = 2π", "tip displacement x", "m", -1.0, p.roll_up, "exact", "", "exact"),
    *(
        _row(f"shear cantilever, {size} force", f"tip displacement {'xy'[k]}, size", "m", printed,
             partial(p.thick, load=load, axis=k), NACHBAGAUER, SHEAR)
        for size, load, k, printed in [
            ("small", 5e5, 1, "8.09900305e-4"), ("large", 5e8, 0, "0.15097103"), ("large", 5e8, 1, "0.71056837"),
        ]
    ),
    _row("Lee's frame", "first limit load", "N", 18.7e3, partial(p.lees_frame, limit=0), "digitised", "", "curve"),
    _row("Lee's frame", "second limit load", "N", -9.3e3, partial(p.lees_frame, limit=1), "digitised", "", "curve"),
    _row("catenary, EI → 0", "lowest point y", "m", p.exact_catenary(), p.catenary, "exact (extensible)", "", "exact"),
    *(
        _row("L-frame, 4 + 4 elements", "tip displacement y", "m", printed, p.l_frame, source, COARSE)
        for printed, source in [
            ("-0.9181474510515", "Exudyn LShapeGeomExactBeam2D, as quoted"),
            ("-2.2115028353806", "Exudyn LShapeGeomExactBeam2D, commit 30ec2d5"),
        ]
    ),
    *(
        _row("rotating blade", f"flap frequency at speed {speed}", "", printed, partial(p.flap, speed=speed), WRIGHT,
             LAG)
        for speed, printed in {0: "3.5160", 1: "3.6817", 2: "4.1373", 5: "6.4495", 10: "11.2023"}.items()
    ),
    _row("spin-up", "mean stretch of the steady turn", "m", "5.143e-4", p.spin_up, SIMO,
         "linear theory, ρA Ω² L³/(3 EA), for a beam that stays straight"),
    *(
        _row("Andrews' squeezer", f"{name} at 0.03 s", "rad", repr(value), partial(p.squeezer, angle=name), IVP,
             "of the finer of two steps of fourth order; uncertainty: their difference")
        for name, value in SQUEEZED.items()
    ),
    _row("flying spaghetti", "loaded end u_x at 7.5 s", "m", 10.1945, None, "one run of another code",
         "a beam whose GA and rotary inertia are given apart from EA and EI: here they follow from one section and "
         "one material", "curve"),
)  # fmt: skip
LEFT_OUT = "Andrews' squeezer, and takes coarser meshes."
NOTES = (
    "found: the limit of three meshes, each twice the one before, by Richardson's extrapolation with the observed "
    "order; uncertainty: what is left of it. Empty: the published number is of one mesh, on which it was found.",
    "allowed: half of the last published digit, or 2 % where it was read off a curve. Confirmed as printed: rounded, "
    "the found value is the printed one. Otherwise confirmed to as many digits as agree and as its own uncertainty "
    "leaves; not beyond: the difference is larger than allowed and uncertainty together.",
)


def published(quick: bool = False) -> pd.DataFrame:
    """A row a published number: what is found here, and the verdict."""
    rows = []
    for entry in PUBLISHED:
        if quick and entry.problem.startswith("Andrews"):
            continue
        row: dict[str, Any] = {
            "problem": entry.problem, "quantity": entry.quantity, "unit": entry.unit, "published": entry.value,
            "allowed": entry.uncertainty, "source": entry.source, "note": entry.note,
        }  # fmt: skip
        if entry.find is None:
            rows.append({**row, "verdict": f"not comparable: {entry.note}"})
            continue
        try:
            found = entry.find(quick)
        except AnctmmError as error:
            rows.append({**row, "verdict": f"not run: {error}"})
            continue
        digits, verdict = judged(entry, found)
        row |= {"found": found.value, "uncertainty": found.uncertainty, "digits": digits, "verdict": verdict}
        rows.append(row)
    return pd.DataFrame(rows)


def judged(entry: Published, found: Value) -> tuple[int, str]:
    """Confirmed digits, and the verdict in words."""
    difference, printed = abs(found.value - entry.value), _printed(entry)
    left = _digits(abs(found.value), found.uncertainty)
    if entry.kind == "printed" and left >= printed and difference + found.uncertainty <= entry.uncertainty:
        return printed, f"confirmed as printed ({_counted(printed)})"
    digits = min(_digits(max(abs(found.value), abs(entry.value)), difference), left)
    digits = min(digits, printed - 1) if entry.kind == "printed" else digits
    allowed = entry.uncertainty + found.uncertainty
    if difference > allowed and digits < FEW:
        return digits, f"contradicted: difference {difference:.2g} {entry.unit}, {allowed:.1g} allowed"
    if digits == 0:
        return 0, f"undecided: the value found here is uncertain by {found.uncertainty:.1g} {entry.unit}"
    beyond = ", not beyond" if difference > allowed else ""
    if entry.kind == "printed":
        return digits, f"confirmed to {digits} of {_counted(printed)}{beyond}"
    within = f", within the {DIGITISED:.0%} of the curve" if entry.kind == "curve" and not beyond else ""
    return digits, f"confirmed to {_counted(digits)}{within}{beyond}"


def findings(frame: pd.DataFrame) -> tuple[str, ...]:
    """The table in sentences: counts of the verdicts, and each number that is not simply confirmed."""
    verdict = frame["verdict"].str
    kinds = {
        "confirmed as printed": verdict.startswith("confirmed as printed"),
        "confirmed to fewer digits": verdict.startswith("confirmed to"),
        "undecided": verdict.startswith("undecided"),
        "contradicted": verdict.startswith("contradicted"),
        "not comparable or not run": verdict.startswith("not "),
    }
    counts = ", ".join(f"{mask.sum()} {name}" for name, mask in kinds.items() if mask.any())
    special = frame[
        verdict.contains("not beyond") | kinds["contradicted"] | kinds["not comparable or not run"]
    ]
    sentences = (f"{r.problem}, {r.quantity}: {r.verdict} ({r.source})." for r in special.itertuples())
    return (f"Of {len(frame)} published numbers {counts}.", *sentences)


def run(options: Any, runner: Any) -> Any:
    """The study as `anctmm study published` runs it."""
    from studies.engine.study import Result, check_taken
    from studies.engine.tables import Table

    check_taken(options, "published")
    frame = published(options.quick)
    sentences = findings(frame)
    return Result(
        "published", "Published problems", "What do the solvers here find for numbers that others have published?",
        sentences, (), (Table("verdicts", "Published numbers, and the values found here", frame, NOTES),),
        answers=sentences[:1], left_out=LEFT_OUT if options.quick else "",
    )  # fmt: skip


def _printed(entry: Published) -> int:
    """Digits that the published number has."""
    return max(0, floor(log10(abs(entry.value) / (2.0 * entry.uncertainty)) + 1e-9) + 1)


def _digits(size: float, error: float) -> int:
    """Significant digits of a number of this size that an error leaves."""
    if error == 0.0:
        return ALL
    return 0 if error >= size else min(ALL, floor(-log10(error / size)))


def _counted(count: int) -> str:
    return f"{count} digit{'s' if count != 1 else ''}"
