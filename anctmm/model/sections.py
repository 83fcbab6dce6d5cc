"""Cross-sections: area and even moments about the neutral axis, odd moments zero.

See anctmm/elimination/method.md, section 1.
"""

from dataclasses import dataclass, field
from math import pi

from anctmm.errors import PropertyError
from anctmm.validation import LONGEST, SHORTEST, positive


@dataclass(frozen=True)
class Section:
    """Cross-section given by its moments.

    Parameters
    ----------
    area : float
        A = ∫dA, m².
    second_moment : float
        I = ∫y²dA, m⁴.
    fourth_moment : float
        J = ∫y⁴dA, m⁶; at least I²/A by the Cauchy-Schwarz inequality.

    Raises
    ------
    PropertyError
        If a moment is not finite and positive, or J is less than I²/A.
    """

    area: float
    second_moment: float
    fourth_moment: float

    def __post_init__(self) -> None:
        A = positive("section area (m²)", self.area)
        I = positive("section second_moment (m⁴)", self.second_moment)  # noqa: E741
        J = positive("section fourth_moment (m⁶)", self.fourth_moment)
        for name, value in (("area", A), ("second_moment", I), ("fourth_moment", J)):
            object.__setattr__(self, name, value)
        if J < I * I / A * (1.0 - 1e-12):
            raise PropertyError(
                f"section fourth_moment (m⁶) is {J!r}; no section of area {A!r} and second moment {I!r} "
                f"has less than I²/A = {I * I / A!r}"
            )


@dataclass(frozen=True, repr=False, eq=False)
class Circle(Section):
    """Full circle; J = πr⁶/8.

    Parameters
    ----------
    diameter : float
        m.
    """

    area: float = field(init=False)
    second_moment: float = field(init=False)
    fourth_moment: float = field(init=False)
    diameter: float = field(repr=False, compare=False)

    def __post_init__(self) -> None:
        d = positive("circle diameter (m)", self.diameter, low=SHORTEST, high=LONGEST)
        r = 0.5 * d
        _set(self, diameter=d, area=pi * r**2, second_moment=pi * r**4 / 4, fourth_moment=pi * r**6 / 8)


@dataclass(frozen=True, repr=False, eq=False)
class Rectangle(Section):
    """Rectangle; J = bh⁵/80.

    Parameters
    ----------
    width : float
        b, across the plane of motion, m.
    height : float
        h, in the plane of motion, m.
    """

    area: float = field(init=False)
    second_moment: float = field(init=False)
    fourth_moment: float = field(init=False)
    width: float = field(repr=False, compare=False)
    height: float = field(repr=False, compare=False)

    def __post_init__(self) -> None:
        b = positive("rectangle width (m)", self.width, low=SHORTEST, high=LONGEST)
        h = positive("rectangle height (m)", self.height, low=SHORTEST, high=LONGEST)
        moments = {"area": b * h, "second_moment": b * h**3 / 12, "fourth_moment": b * h**5 / 80}
        _set(self, width=b, height=h, **moments)


def _set(section: Section, **values: float) -> None:
    """Give a new section its sizes and its moments, which are checked as those of any section."""
    for name, value in values.items():
        object.__setattr__(section, name, value)
    Section.__post_init__(section)
