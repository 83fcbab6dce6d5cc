"""What a solver says it can do, so that what it cannot is shown and not passed over."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from anctmm.errors import DiscretisationError, unknown_option
from anctmm.validation import one_of

#: What a solver may lack, and what that means. Whoever lacks something says so; asked for it all the same, it answers
#: with the status "unsupported" or raises an error of `anctmm.errors`.
FEATURES = {
    "statics": "rest positions, by `solve_static` beside `solve`",
    "stability": "the status of a rest position that is not stable says so",
    "zhai": "explicit steps",
    "generalized-alpha": "implicit steps",
    "joints": "pins and welds between bodies",
    "drives": "clamps that turn",
    "varying-loads": "loads that vary in time",
    "damping": "Kelvin-Voigt damping of materials",
    "rigid": "rigid bodies",
    "energy": "energies of the history; NaN where lacking",
}


@dataclass(frozen=True)
class Offer:
    """A solver's claims; stands as `OFFER` in the module of its `solve`, and is everything where there is none.

    Parameters
    ----------
    lacks : iterable of str
        What is not offered, of `FEATURES`.
    element : str
        The one element it uses whatever a discretisation asks for; empty where it uses what is asked.
    limits : mapping of str to str
        By the element asked for, the continuum its rest positions tend to: "elastica", "reissner" or "director" (see
        `reference.exact`). Elements that are not in it are not asked for in statics.

    Raises
    ------
    UnknownOptionError
        If it lacks something that is no feature.
    DiscretisationError
        If it lacks both kinds of steps.
    """

    lacks: frozenset[str] = frozenset()
    element: str = ""
    limits: Mapping[str, str] = field(default_factory=lambda: {"cable": "elastica", "shear": "director"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "lacks", _features(self.lacks))
        for element, limit in self.limits.items():
            one_of("an Offer's element", element, ("cable", "shear"))
            one_of(f"an Offer's limit of {element!r}", limit, ("elastica", "reissner", "director"))
        if not self.integrators:
            raise DiscretisationError("an Offer lacks 'zhai' and 'generalized-alpha'; one of them is needed")

    @property
    def integrators(self) -> tuple[str, ...]:
        """Integrators it has, implicit steps first."""
        return tuple(i for i in ("generalized-alpha", "zhai") if i not in self.lacks)

    def element_of(self, asked: str) -> str:
        """Name of the element it uses for one asked for."""
        return self.element or asked


def _features(lacks: object) -> frozenset[str]:
    """Names of features, each one of `FEATURES`."""
    name = "a feature an Offer lacks"
    if isinstance(lacks, str | bytes) or not isinstance(lacks, Iterable):
        raise unknown_option(f"{name}, in a list,", lacks, sorted(FEATURES))
    return frozenset(one_of(name, feature, FEATURES) for feature in lacks)
