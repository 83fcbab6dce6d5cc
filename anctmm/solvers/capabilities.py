"""Capabilities that a solver declares, so that missing features are reported and not ignored."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from anctmm.elements.kinds import KINDS
from anctmm.errors import DiscretisationError, shown, unknown_option
from anctmm.model.needs import MECHANISMS, WITH
from anctmm.validation import one_of, positive

#: What a solver may lack, and what that means. Whoever lacks something says so; asked for it all the same, it answers
#: with the status "unsupported" or raises an error of `anctmm.errors`.
FEATURES = {
    "statics": "static equilibria, by `solve_static` beside `solve`",
    "stability": "the status of an equilibrium that is not stable says so",
    "zhai": "explicit steps",
    "generalized-alpha": "implicit steps",
    "esdirk": "implicit steps of fourth order",
    "joints": "pins and welds between bodies",
    "branches": "joints of more than two ends, and ends in several joints",
    "loops": "bodies that close a loop which does not pass through the ground",
    "drives": "clamps that turn",
    "varying-loads": "loads that vary in time",
    "damping": "Kelvin-Voigt damping of materials",
    **{kind.name: kind.title for kind in KINDS.values() if kind.optional},
    **MECHANISMS,
    "energy": "energies of the history; NaN where lacking",
}
#: Integrators, one of which a solver has, and those that it may have beside them.
STEPPING, HIGH_ORDER = ("generalized-alpha", "zhai"), ("esdirk",)
#: Bounds of Newton's last correction that studies of cost try: from one that stops as soon as a step's error allows to
#: one near rounding.
NEWTON_TOLERANCES = (1e-7, 1e-5, 1e-3)
#: Features that need others.
NEEDED = {"branches": "joints", "loops": "joints"}
#: Continua that rest positions of our elements tend to, by element.
LIMITS = {kind.name: kind.continuum for kind in KINDS.values() if kind.continuum}


@dataclass(frozen=True)
class Offer:
    """Capabilities of a solver: `OFFER` in the module of its `solve`; without it the solver claims everything.

    Parameters
    ----------
    lacks : iterable of str
        Missing features, of `FEATURES`, and missing combinations of features, such as "rigid + generalized-alpha" of a
        solver that has rigid bodies in explicit runs only.
    extras : iterable of str
        Optional features, of `HIGH_ORDER`: a solver has them only if they are named here.
    slow_with : iterable of str
        Features of scenes, of `FEATURES`, that it implements for verification and not for speed: studies of cost then
        compare its times only if the solver is requested by name.
    element : str
        The one element it uses whatever the discretisation says; empty if it uses the requested one.
    order : float
        Order in space of that element, if it is none of ours: studies write it beside the observed one.
    limits : mapping of str to str
        By the requested element, the continuum to which its equilibria converge: "elastica", "reissner" or "director"
        (see `reference.exact`). Other elements are not used in statics.
    choices : tuple of mapping of str to value
        Settings of an implicit run with the same mesh and step: sets of keyword arguments of `solve`, the one with the
        tightest bounds of the iteration first. Studies of cost try them all, so that every solver is used at its best;
        the error of a choice never counts as smaller than that of the first. Default: `NEWTON_TOLERANCES`.

    Raises
    ------
    UnknownOptionError
        If it lacks something that is no feature.
    DiscretisationError
        If it lacks both kinds of steps, or a choice is no mapping of names.
    """

    lacks: frozenset[str] = frozenset()
    element: str = ""
    order: float = 2.0
    limits: Mapping[str, str] = field(default_factory=lambda: dict(LIMITS))
    choices: tuple[Mapping[str, Any], ...] = tuple({"newton_tolerance": t} for t in NEWTON_TOLERANCES)
    extras: frozenset[str] = frozenset()
    slow_with: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "lacks", _lacks(self.lacks))
        extras = frozenset(one_of("an Offer's extra", extra, HIGH_ORDER) for extra in self.extras)
        set_(self, "extras", extras - self.lacks)
        slow = frozenset(one_of("a feature an Offer is slow with", part, FEATURES) for part in self.slow_with)
        set_(self, "slow_with", slow)
        set_(self, "order", positive("an Offer's order", self.order, DiscretisationError))
        for element, limit in self.limits.items():
            one_of("an Offer's element", element, LIMITS)
            one_of(f"an Offer's limit of {element!r}", limit, ("elastica", "reissner", "director"))
        if not self.choices or not all(isinstance(choice, Mapping) for choice in self.choices):
            raise DiscretisationError(
                f"an Offer's choices are {shown(self.choices)}; one or more sets of keyword arguments are needed"
            )
        if not set(STEPPING) - self.lacks:
            raise DiscretisationError("an Offer lacks 'zhai' and 'generalized-alpha'; one of them is needed")

    @property
    def integrators(self) -> tuple[str, ...]:
        """Its integrators: implicit steps of second order first, those of higher order last."""
        return tuple(i for i in STEPPING if i not in self.lacks) + tuple(
            i for i in HIGH_ORDER if i in self.extras
        )

    def lacking(self, features: Iterable[str]) -> list[str]:
        """Entries of `lacks` that exclude features which are needed together, sorted."""
        needed = set(features)
        needed |= {NEEDED[feature] for feature in needed if feature in NEEDED}
        lacks = self.lacks | (frozenset(HIGH_ORDER) - self.extras)
        return sorted(lack for lack in lacks if needed.issuperset(features_of(lack)))

    def element_of(self, asked: str) -> str:
        """Name of the element that it uses for a requested one."""
        return self.element or asked

    def order_of(self, asked: str) -> float:
        """Order in space of the element that it uses for a requested one."""
        own = self.element_of(asked)
        return KINDS[own].order if own in KINDS else self.order


def uncombined() -> frozenset[str]:
    """Combinations of features that ANC-TMM lacks, as its kinds of element say."""
    found = set()
    for kind in KINDS.values():
        lacking = {*STEPPING, *HIGH_ORDER} - set(kind.integrators) | (set() if kind.statics else {"statics"})
        found |= {WITH.join((kind.name, feature)) for feature in lacking if kind.optional}
    return frozenset(found)


def features_of(lack: str) -> tuple[str, ...]:
    """Features of a combination, or the one feature."""
    return tuple(lack.split(WITH))


def _lacks(lacks: Iterable[str]) -> frozenset[str]:
    """Features, each one of `FEATURES`, and combinations, written in one way whatever their order and spaces."""
    name = "a feature an Offer lacks"
    if isinstance(lacks, str):
        raise unknown_option(f"{name}, in a list,", lacks, sorted(FEATURES))
    parts = [[part.strip() for part in lack.split(WITH.strip())] for lack in lacks]
    return frozenset(WITH.join(sorted({one_of(name, part, FEATURES) for part in some})) for some in parts)
