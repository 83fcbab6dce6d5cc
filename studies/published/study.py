"""Published numbers as a table, and whether the solvers here find them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from math import floor, log10
from typing import Any, NamedTuple

import pandas as pd
from threadpoolctl import threadpool_limits

from anctmm.errors import AnctmmError
from reference.exact.andrews import PUBLISHED as SQUEEZED
from studies.engine.study import Result, check_taken
from studies.engine.tables import Table
from studies.published import problems as p

#: What a formula, and a digitised curve or a single run of another code, may be off by, of the number.
OFF = {"exact": 1e-15, "curve": 0.02}
#: Digits from which on two numbers are the same except for the last ones; and those of a double.
FEW, ALL = 3, 15
EXUDYN = "Exudyn, test models"
NACHBAGAUER = "Nachbagauer et al. 2011, 10.1007/s11044-011-9249-8"
WRIGHT = "Wright et al. 1982, J. Appl. Mech. 49, 197–202"
SIMO = "Simo & Vu-Quoc 1986, J. Appl. Mech. 53, 855–863"
IVP = "Test Set for Initial Value Problem Solvers, tolerance 1e-14"
SHEAR = "needs Reissner's beam: the paper's shear element has Green's strains and locks for ν > 0"
COARSE = "on the published mesh of linear elements of Exudyn's beam of Reissner's kind"


class Found(NamedTuple):
    """A value with the uncertainty of its discretisation; 0 where the published number is for the same mesh."""

    found: float
    uncertainty: float = 0.0


def converged(compute: Callable[[int], float], meshes: Sequence[int]) -> Found:
    """Richardson's limit of a value on three meshes, each twice the one before.

    The uncertainty is the last change divided by 2^p − 1, p the observed order (at most the change itself).
    """
    values = [compute(mesh) for mesh in meshes]
    before, last = values[-2] - values[-3], values[-1] - values[-2]
    if abs(before) <= 2.0 * abs(last):
        return Found(values[-1], abs(last))
    left = last / (abs(before / last) - 1.0) if last else 0.0
    return Found(values[-1] + left, abs(left))


@dataclass(frozen=True)
class Published:
    """One number of a published problem."""

    problem: str
    quantity: str
    unit: str
    printed: str
    source: str
    find: Callable[[int], float] | None = None  # elements → the number; None where it cannot be found here
    finest: int = 0  # elements of the finest of three meshes; a quick run halves them
    note: str = ""
    kind: str = (
        "printed"  # or "mesh": of one, of `finest` elements; "exact": a formula; "curve": read off one
    )

    @property
    def value(self) -> float:
        """The number."""
        return float(self.printed)

    @property
    def digits(self) -> int:
        """Digits that are known of it."""
        return ALL if self.kind == "exact" else len(Decimal(self.printed).as_tuple().digits)

    @property
    def uncertainty(self) -> float:
        """Of the number: half of its last digit, or what reading a curve may be off by."""
        if self.kind in OFF:
            return OFF[self.kind] * abs(self.value)
        return 0.5 * 10.0 ** int(Decimal(self.printed).as_tuple().exponent)

    def found(self, quick: bool) -> Found:
        """The value found here."""
        assert self.find
        if self.kind == "mesh":
            return Found(self.find(self.finest))
        finest = self.finest // 2 if quick else self.finest
        return converged(self.find, (finest // 4, finest // 2, finest))


# fmt: off
PUBLISHED = (
    *(Published("elastica, F L²/EI = 3", f"tip displacement {'xy'[k]}", "m", printed, EXUDYN,
                partial(p.elastica, axis=k), 128,
                "the value of a finite mesh of cables, as its source says, not of the limit")
      for k, printed in enumerate(["-0.508537304326", "-1.207239854550"])),
    *(Published("elastica, 4 cables", f"tip displacement {'xy'[k]}", "m", printed, EXUDYN,
                partial(p.elastica, axis=k, stretch="free"), 4,
                "on the same mesh, with its clamp, which leaves the stretch free", kind="mesh")
      for k, printed in enumerate(["-0.50742872", "-1.20553370"])),
    Published("roll-up, M L/EI = 2π", "tip displacement x", "m", "-1.0", "exact", p.roll_up, 64, kind="exact"),
    *(Published(f"shear cantilever, {size} force", f"tip displacement {'xy'[k]}, size", "m", printed, NACHBAGAUER,
                partial(p.thick, load=load, axis=k), 128, SHEAR)
      for size, load, k, printed in [
          ("small", 5e5, 1, "8.09900305e-4"), ("large", 5e8, 0, "0.15097103"), ("large", 5e8, 1, "0.71056837")]),
    *(Published("Lee's frame", f"{name} limit load", "N", printed, "digitised",
                partial(p.lees_frame, limit=k), 8, kind="curve")
      for k, (name, printed) in enumerate([("first", "18.7e3"), ("second", "-9.3e3")])),
    Published("catenary, EI → 0", "lowest point y", "m", str(p.exact_catenary()), "exact (extensible)", p.catenary, 64,
              kind="exact"),
    *(Published("L-frame, 4 + 4 elements", "tip displacement y", "m", printed, source, p.l_frame, 4, COARSE,
                kind="mesh")
      for printed, source in [
          ("-0.9181474510515", "Exudyn LShapeGeomExactBeam2D, as quoted"),
          ("-2.2115028353806", "Exudyn LShapeGeomExactBeam2D, commit 30ec2d5")]),
    *(Published("rotating blade", f"flap frequency at speed {speed}", "", printed, WRIGHT,
                partial(p.flap, speed=speed), 48, "from the lag frequency, which is what a planar code finds")
      for speed, printed in {0: "3.5160", 1: "3.6817", 2: "4.1373", 5: "6.4495", 10: "11.2023"}.items()),
    Published("spin-up", "mean stretch of the steady turn", "m", "5.143e-4", SIMO, p.spin_up, 32,
              "linear theory, ρA Ω² L³/(3 EA), for a beam that stays straight"),
    *(Published("Andrews' squeezer", f"{name} at 0.03 s", "rad", repr(value), IVP,
                partial(p.squeezer, name=name), 1200, "the limit of three steps of fourth order")
      for name, value in SQUEEZED.items()),
    Published("flying spaghetti", "loaded end u_x at 7.5 s", "m", "10.1945", "one run of another code", kind="curve",
              note="a beam whose GA and rotary inertia are given apart from EA and EI: here they follow from one "
              "section and one material"),
)
# fmt: on
NOTES = (
    "found: the limit of three meshes, each twice the one before, by Richardson's extrapolation with the observed "
    "order; uncertainty: what is left of it. Empty: the published number is of one mesh, on which it was found.",
    "allowed: half of the last published digit, or 2 % where it was read off a curve. Confirmed as printed: rounded, "
    "the found value is the printed one. Not beyond: the difference is larger than allowed and uncertainty together.",
)


def published(quick: bool = False) -> pd.DataFrame:
    """A row a published number: what is found here, and the verdict."""
    chosen = [e for e in PUBLISHED if not (quick and e.problem.startswith("Andrews"))]
    with threadpool_limits(limits=1):  # matrices are small: threads cost more than they bring
        return pd.DataFrame([_row(entry, quick) for entry in chosen])


def _row(entry: Published, quick: bool) -> dict[str, Any]:
    row: dict[str, Any] = {
        "problem": entry.problem, "quantity": entry.quantity, "unit": entry.unit, "published": entry.value,
        "allowed": entry.uncertainty, "source": entry.source, "note": entry.note,
    }  # fmt: skip
    if entry.find is None:
        return {**row, "verdict": f"not comparable: {entry.note}"}
    try:
        found = entry.found(quick)
    except AnctmmError as error:
        return {**row, "verdict": f"not run: {error}"}
    digits, verdict = judged(entry, found)
    return {**row, **found._asdict(), "digits": digits, "verdict": verdict}


def judged(entry: Published, found: Found) -> tuple[int, str]:
    """Confirmed digits, and the verdict in words."""
    difference, allowed = abs(found.found - entry.value), entry.uncertainty + found.uncertainty
    if entry.kind not in OFF and difference + found.uncertainty <= entry.uncertainty:
        return entry.digits, f"confirmed as printed ({entry.digits} digits)"
    size = max(abs(found.found), abs(entry.value))
    digits = min(entry.digits, _digits(size, difference), _digits(size, found.uncertainty))
    if difference > allowed and digits < FEW:
        return digits, f"contradicted: difference {difference:.2g} {entry.unit}, {allowed:.1g} allowed"
    if digits == 0:
        return 0, f"undecided: the value found here is uncertain by {found.uncertainty:.1g} {entry.unit}"
    beyond = ", not beyond" if difference > allowed else ""
    return digits, f"confirmed to {digits} digit{'s' if digits > 1 else ''}{beyond}"


def _digits(size: float, error: float) -> int:
    """Significant digits of a number of this size that an error leaves."""
    if error == 0.0:
        return ALL
    return 0 if error >= size else min(ALL, floor(-log10(error / size)))


def findings(frame: pd.DataFrame) -> tuple[str, ...]:
    """The table in sentences: counts of the verdicts, and each number that is not simply confirmed."""
    verdict = frame["verdict"].str
    kinds = ("confirmed as printed", "confirmed to", "undecided", "contradicted", "not comparable", "not run")
    counts = {kind: int(verdict.startswith(kind).sum()) for kind in kinds}
    in_all = ", ".join(f"{n} {kind.replace(' to', ' to fewer digits')}" for kind, n in counts.items() if n)
    special = frame[verdict.contains("not beyond") | verdict.startswith(("contradicted", "not "))]
    sentences = (f"{r.problem}, {r.quantity}: {r.verdict} ({r.source})." for r in special.itertuples())
    return (f"Of {len(frame)} published numbers {in_all}.", *sentences)


def run(options: Any, runner: Any) -> Result:
    """The study as `anctmm study published` runs it."""
    check_taken(options, "published")
    frame = published(options.quick)
    sentences = findings(frame)
    return Result(
        "published", "Published problems", "What do the solvers here find for numbers that others have published?",
        sentences, (), (Table("verdicts", "Published numbers, and the values found here", frame, NOTES),),
        answers=sentences[:1], left_out="Andrews' squeezer, and takes coarser meshes." if options.quick else "",
    )  # fmt: skip
