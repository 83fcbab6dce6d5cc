"""Texts for the places of a scene, all different."""

from collections import Counter
from collections.abc import Callable, Iterable

from anctmm.model.places import Written


def place_texts(places: Iterable[Written]) -> dict[Written, str]:
    """Places in words, fractions with six digits, or with all if two places would have the same text."""
    short = {place: _text(place, "{:g}".format) for place in places}
    shared = Counter(short.values())
    return {place: text if shared[text] == 1 else _text(place, repr) for place, text in short.items()}


def _text(place: Written, number: Callable[[float], str]) -> str:
    return place if isinstance(place, str) else f"{place[0]} at {number(float(place[1]))}"
