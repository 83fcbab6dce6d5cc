"""Choices of a kind of element for each beam of a scene: every one of few beams, single ones and best ones of many."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, product

from anctmm.model.scene import Beam, Scene, Weld

#: A kind for each beam, in the scene's order.
Kinds = tuple[str, ...]
#: Choices that are all tried, at most; beams, or groups of equal beams, that are chosen one by one, at most.
MOST_CHOICES, MOST_UNITS = 27, 8
#: Names that a text lists at most.
LISTED = 4


@dataclass(frozen=True)
class Choices:
    """What may be chosen for a scene.

    Parameters
    ----------
    names : tuple of str
        Of the beams.
    units : tuple of tuple of int
        Places of the beams that are chosen together.
    kinds : tuple of str
        Kinds to choose from, the richest first.
    welded : tuple of frozenset of int
        For each beam those that welds join it to, and itself: none of them can be of shear elements beside a cable.
    """

    names: tuple[str, ...]
    units: tuple[tuple[int, ...], ...]
    kinds: tuple[str, ...]
    welded: tuple[frozenset[int], ...]

    @classmethod
    def of(cls, scene: Scene, kinds: Sequence[str]) -> "Choices":
        """Each beam alone; of many beams those of one section, material and length together, the longest ones first."""
        beams = scene.beams
        units: list[tuple[int, ...]] = [(k,) for k in range(len(beams))]
        if len(beams) > MOST_UNITS:
            order = sorted(range(len(beams)), key=lambda k: (_like(beams[k]), k))
            units = [tuple(group) for _, group in groupby(order, key=lambda k: _like(beams[k]))]
            units = sorted(sorted(units, key=lambda u: -beams[u[0]].length * len(u))[:MOST_UNITS])
        return cls(tuple(beam.name for beam in beams), tuple(units), tuple(kinds), _welded(scene))

    @property
    def all_tried(self) -> bool:
        """Whether there are so few that every one is tried."""
        return self._single and len(self.kinds) ** len(self.units) <= MOST_CHOICES

    @property
    def richest(self) -> Kinds:
        """The richest kind for all."""
        return self.uniform(self.kinds[0])

    @property
    def _single(self) -> bool:
        return sum(map(len, self.units)) == len(self.names)

    def uniform(self, kind: str) -> Kinds:
        """One kind for all."""
        return (kind,) * len(self.names)

    def first(self) -> list[Kinds]:
        """What is tried before anything is known, the richest first."""
        if self.all_tried:
            every = (self._spread(chosen) for chosen in product(self.kinds, repeat=len(self.units)))
            return [kinds for kinds in every if self._can_be(kinds)]
        found = [self.uniform(kind) for kind in self.kinds]
        for base, poorer in self._bases():
            found += [self.alone(unit, kind, base) for unit in range(len(self.units)) for kind in poorer]
        return list(dict.fromkeys(found))

    def alone(self, unit: int, kind: str, base: str) -> Kinds:
        """One unit of a kind, all others of another; of cables beside shear elements with all that welds join it to."""
        inside = set(self.units[unit])
        if (kind, base) == ("cable", "shear"):
            inside = set().union(*(self.welded[k] for k in inside))
        return tuple(kind if k in inside else base for k in range(len(self.names)))

    def best(self, distance: Mapping[tuple[int, str], float], targets: Sequence[float]) -> list[Kinds]:
        """Combinations of poorer units whose distances alone sum up to no more than a target.

        Parameters
        ----------
        distance : mapping of (unit, kind) to float
            Where it alone is of that kind; what is missing cannot be.
        targets : sequence of float
        """
        found = []
        for target in targets:
            for base, poorer in self._bases():
                kinds, total = list(self.uniform(base)), 0.0
                options = sorted(
                    (distance[unit, kind], -self.kinds.index(kind), unit, kind)
                    for unit in range(len(self.units)) for kind in poorer if (unit, kind) in distance
                )  # fmt: skip
                taken: dict[int, float] = {}
                for d, _, unit, kind in options:  # a later kind of a unit is poorer, and further away
                    if total - taken.get(unit, 0.0) + d <= target:
                        total += d - taken.get(unit, 0.0)
                        taken[unit] = d
                        for k in self.units[unit]:
                            kinds[k] = kind
                found.append(tuple(kinds))
        return [kinds for kinds in dict.fromkeys(found) if self._can_be(kinds)]

    def _can_be(self, kinds: Kinds) -> bool:
        """Whether no weld joins shear elements to cables."""
        return all(len({kinds[k] for k in those} - {"rigid"}) < 2 for those in self.welded)

    def _bases(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Kinds of all others, with the poorer ones: welds join shear elements to none but each other."""
        for k in range(len(self.kinds) - 1):
            yield self.kinds[k], self.kinds[k + 1 :]

    def _spread(self, chosen: Sequence[str]) -> Kinds:
        kinds = list(self.richest)
        for unit, kind in zip(self.units, chosen, strict=True):
            for k in unit:
                kinds[k] = kind
        return tuple(kinds)


def said(kinds: Kinds, names: Sequence[str]) -> str:
    """A choice in words."""
    if len(set(kinds)) == 1:
        return f"all {kinds[0]}" if len(kinds) > 1 else kinds[0]
    if len(kinds) <= 2:
        return ", ".join(f"{name} {kind}" for name, kind in zip(names, kinds, strict=True))
    usual = max(dict.fromkeys(kinds), key=kinds.count)
    parts = [usual]
    for kind in dict.fromkeys(k for k in kinds if k != usual):
        those = [name for name, k in zip(names, kinds, strict=True) if k == kind]
        more = f" and {len(those) - LISTED} more" if len(those) > LISTED else ""
        parts.append(f"{', '.join(those[:LISTED])}{more} {kind}")
    return f"{parts[0]}, but {'; '.join(parts[1:])}"


def _welded(scene: Scene) -> tuple[frozenset[int], ...]:
    """For each beam those that a row of welds joins it to, and itself."""
    place = {beam.name: k for k, beam in enumerate(scene.beams)}
    groups = [{k} for k in place.values()]
    for joint in scene.joints:
        if isinstance(joint, Weld):
            names = {scene.place(end).body.name for end in joint.ends}
            for k in (ends := [place[name] for name in names if name in place]):
                groups[ends[0]] |= groups[k]
            for k in tuple(groups[ends[0]]) if ends else ():
                groups[k] = groups[ends[0]]
    return tuple(frozenset(group) for group in groups)


def _like(beam: Beam) -> tuple[float, ...]:
    s, m = beam.section, beam.material
    size = round(beam.length, 12)
    return (s.area, s.second_moment, m.E, m.density, m.poisson, m.damping, size)
