"""Connectors whose places are kept, so that their stiffness stands in the sparse system of loops.

A connector between distant places couples nodes that the recursion does not pass one after the other. A few such
couplings are a low-rank change of the matrix (`anctmm.recursion.low_rank`), whose cost grows with the square of their
number at each solution and with the cube at each factorization. Of many the places are kept like junctions of loops:
beams are divided there, and a connector adds a block between two kept places, which costs the same for each.
"""

from collections.abc import Iterable, Mapping, Set

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.model.bodies import Beam
from anctmm.model.connectors import Connector
from anctmm.model.places import Place
from anctmm.model.scene import LineLoad, Scene, Spring

#: Rows of a low-rank change up to which it is used, without beams that would be divided, and with such. Kept places
#: take 0.8 of the time from 24 rows on in steps of masses and of short beams. Beams divided at each of their nodes take
#: 1.9 times as long at 20 rows and 1.2 times at 64, as their elements are no longer computed eight at a time; from 96
#: rows on they take less.
FEW, DIVIDED = 16, 96
#: Distance of a place from a node, in elements, at which it is the node.
AT_NODE = 1e-9


def rows_of(connector: Connector) -> int:
    """Rows of a low-rank change that a connector takes at most: along it and across, or of an angle."""
    if len(connector.places) < 2:
        return 0
    return 2 if isinstance(connector, Spring) else 1


def coupled_connectors(scene: Scene, run: Discretisation) -> frozenset[int]:
    """Numbers of the connectors of a scene whose places are kept; explicit steps need none of their stiffness."""
    if run.explicit or sum(map(rows_of, scene.connectors)) <= FEW:
        return frozenset()
    cut = run.of(scene)
    places = {
        n: [scene.place(place) for place in connector.places]
        for n, connector in enumerate(scene.connectors)
        if rows_of(connector)
    }
    whole = {load.body for load in scene.loads if isinstance(load, LineLoad) and callable(load.value)}
    found = frozenset(n for n, pair in places.items() if _may_be_kept(pair, cut, whole))
    divided = any(_inside(place, cut) for n in found for place in places[n])
    rows = sum(rows_of(scene.connectors[n]) for n in found)
    return found if rows > (DIVIDED if divided else FEW) else frozenset()


def divided_at(scene: Scene, run: Discretisation, connectors: Iterable[int]) -> set[tuple[str, int, int]]:
    """Beams, and nodes before and at or behind a place, where connectors act between the ends of these."""
    cut, found = run.of(scene), set[tuple[str, int, int]]()
    for place in (scene.place(place) for n in connectors for place in scene.connectors[n].places):
        nodes = nodes_at(place, cut)
        if nodes is not None and _inside(place, cut):
            found.add((place.body.name, *nodes))
    return found


def nodes_at(place: Place, cut: Mapping[str, tuple[int, str]]) -> tuple[int, int] | None:
    """First and last node of a beam that a place depends on, from its start; None on a body of one node."""
    if not isinstance(place.body, Beam):
        return None
    elements, kind = cut[place.body.name]
    if kind_of(kind).rigid:
        return None
    along = float(place.key) * elements
    nearest = round(along)
    return (nearest, nearest) if abs(along - nearest) <= AT_NODE else (int(along), int(along) + 1)


def _may_be_kept(places: list[Place], cut: Mapping[str, tuple[int, str]], whole: Set[str]) -> bool:
    """Whether a connector acts between nodes that may all be kept; within one element its stiffness is the element's.

    Beams whose elements have a vector that welds do not hold are not divided: that would free it. Nor are those that
    shall stay `whole`: each part would have a history of its own of a line load that varies.
    """
    for place in places:
        name = place.body.name
        if _inside(place, cut) and (name in whole or not kind_of(cut[name][1]).jointed_inside):
            return False
    one, two = places
    return one.body.name != two.body.name or nodes_at(one, cut) != nodes_at(two, cut)


def _inside(place: Place, cut: Mapping[str, tuple[int, str]]) -> bool:
    """Whether a place is no end of a beam, nor on a body of one node."""
    nodes = nodes_at(place, cut)
    return nodes is not None and not (nodes[0] == nodes[1] and nodes[0] in (0, cut[place.body.name][0]))
