"""An answer of a study: a question, a value, and a recommendation."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Answer:
    """A line of what the page begins with.

    Parameters
    ----------
    question : str
        As a reader asks it.
    figure : str
        The number that answers it, with its unit and, where it is known, its uncertainty; empty without one.
    take : str
        What to take or to conclude, in a sentence.
    """

    question: str
    figure: str
    take: str

    def __str__(self) -> str:
        return " ".join(filter(None, (self.question, f"{self.figure}:" if self.figure else "", self.take)))


def answers_of(question: str, given: Iterable[Answer | str]) -> list[Answer]:
    """Answers; a sentence alone answers the question of its study."""
    return [a if isinstance(a, Answer) else Answer(question, "", a) for a in given]
