"""Cross-sections: area and even moments about the neutral axis, odd moments zero.

See anctmm/recursion/method.md, section 1.
"""

from dataclasses import dataclass
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


class Circle(Section):
    """Full circle; J = πr⁶/8."""

    def __init__(self, diameter: float) -> None:
        r = 0.5 * positive("circle diameter (m)", diameter, low=SHORTEST, high=LONGEST)
        super().__init__(pi * r**2, pi * r**4 / 4, pi * r**6 / 8)


class Rectangle(Section):
    """Rectangle, `height` lying in the plane of motion; J = bh⁵/80."""

    def __init__(self, width: float, height: float) -> None:
        b = positive("rectangle width (m)", width, low=SHORTEST, high=LONGEST)
        h = positive("rectangle height (m)", height, low=SHORTEST, high=LONGEST)
        super().__init__(b * h, b * h**3 / 12, b * h**5 / 80)
