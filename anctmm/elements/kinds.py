"""The kinds of element of a body, and the properties of each.

All code that depends on the kind reads it here: discretisation, mesh, assembly, welds, checks of results,
what solvers offer, studies and their tables.

A new kind needs an entry in `KINDS`, and of what it does not share with another kind:

- a readable element, a class such as `CableElement`: `of`, `energy`, `force`, `tangent`, `dissipation`,
  `damping_force`, `damping_matrix`, `mass`, `gravity`, `load`, `axis`, `turning`, `degree`, `highest_frequency`,
  `damping`, `l` and `vectors_per_node`; energy, force and dissipation complex-step safe;
- kernels, a module such as `cable_kernel`;
- a vector of its nodes, in `VECTORS`;
- where its axis is a polynomial of another degree, its field in `anctmm.results.fields`;
- where it has no strain, its node in `anctmm.system.body_meshes`.

A solver that stands beside ANC-TMM names the kinds it takes (`check_kinds`): a new kind is refused by all of them until
they do.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

from anctmm.elements import cable_kernel, quintic_kernel, shear_kernel
from anctmm.elements.cable import RULES, CableElement
from anctmm.elements.quintic import QuinticElement
from anctmm.elements.rigid import RigidElement
from anctmm.elements.shear import ShearElement
from anctmm.errors import DiscretisationError, unknown_option
from anctmm.model.bodies import Beam
from anctmm.validation import one_of

Element = ShearElement | CableElement

#: Rules of quadrature, by name, of the elements that have a choice.
QUADRATURES = tuple(RULES)


@dataclass(frozen=True)
class NodeVector:
    """A coordinate vector of a node.

    Parameters
    ----------
    derivative : int or None
        Order of the derivative of the axis that it is, from the second on times lengths of an element, so that it has
        no unit; None of the director of the section.
    held : bool
        Whether joints hold it.
    """

    derivative: int | None
    held: bool = True

    @property
    def sign(self) -> float:
        """Its sign where the beam is passed from its end to its start; a director stays to the left of the axis."""
        return -1.0 if self.derivative is None else (-1.0) ** self.derivative


#: All vectors that nodes have, by name; l is the length of an element.
VECTORS: Mapping[str, NodeVector] = {
    "r": NodeVector(0),
    "r_x": NodeVector(1),
    "r_y": NodeVector(None),
    "l r_xx": NodeVector(2, held=False),
}


@dataclass(frozen=True)
class ElementKind:
    """A kind of element.

    Parameters
    ----------
    name : str
        As a discretisation, tables and stored histories call it.
    title : str
        Such elements, in words.
    element : type
        The readable element.
    kernels : module
        The compiled element.
    vectors : tuple of str
        Coordinate vectors of a node, by their names in `VECTORS`, in their order: those that joints hold first, and of
        all "r" and "r_x".
    turned : str
        The one of them that a torque turns.
    quadratures : tuple of str
        Rules of integration that a discretisation may choose from; none where the element has but one.
    rigid : bool
        Whether it has no strain: a body is one element then, and constraints keep its shape.
    integrators : tuple of str
        Those of ANC-TMM that move it.
    statics : bool
        Whether static equilibria are found of it.
    optional : bool
        Whether a solver may lack such elements: `name` is a feature of `anctmm.solvers.capabilities` then.
    continuum : str
        What its equilibria tend to as the mesh is refined, by the names of `reference.exact`; empty where a mesh does
        not matter.
    order : float
        Order of that convergence; NaN where a mesh does not matter.
    """

    name: str
    title: str
    element: type[Element]
    kernels: ModuleType
    vectors: tuple[str, ...]
    turned: str
    quadratures: tuple[str, ...] = ()
    rigid: bool = False
    integrators: tuple[str, ...] = ("zhai", "generalized-alpha", "esdirk")
    statics: bool = True
    optional: bool = False
    continuum: str = ""
    order: float = float("nan")

    @property
    def turned_vector(self) -> int:
        """Number of the vector that a torque turns."""
        return self.vectors.index(self.turned)

    @cached_property
    def held(self) -> tuple[str, ...]:
        """Vectors that joints can hold, the place first."""
        return tuple(vector for vector in self.vectors if VECTORS[vector].held)

    @property
    def jointed_inside(self) -> bool:
        """Whether joints may act at nodes between the ends of a beam: not where these share what a joint must free."""
        return self.held == self.vectors

    def element_of(self, body: Beam, elements: int, quadrature: str) -> Element:
        """Each of a body's equal elements.

        Raises
        ------
        UnknownOptionError
            If the element does not know the quadrature; elements without a choice ignore it.
        """
        if not self.quadratures:
            return self.element.of(body, elements)
        rule = one_of("quadrature", quadrature, self.quadratures)
        return self.element.of(body, elements, rule)  # type: ignore[call-arg]

    def welds_to(self, other: "ElementKind") -> bool:
        """Whether a weld can join it to another kind: all vectors that joints hold pass through, so both have these."""
        return self.held == other.held

    def quadrature_shown(self, quadrature: str) -> str:
        """A quadrature as tables show it: "-" where the element has no choice."""
        return quadrature if self.quadratures else "-"


_CABLE = ElementKind(
    "cable", "cable elements", CableElement, cable_kernel, ("r", "r_x"), "r_x",
    quadratures=QUADRATURES, continuum="elastica", order=4.0,
)  # fmt: skip
_SHEAR = ElementKind(
    "shear", "shear-deformable elements", ShearElement, shear_kernel, ("r", "r_x", "r_y"), "r_y",
    continuum="director", order=2.0,
)  # fmt: skip
_QUINTIC = ElementKind(
    "quintic", "quintic cable elements", QuinticElement, quintic_kernel, ("r", "r_x", "l r_xx"), "r_x",
    optional=True, continuum="elastica", order=8.0,
)  # fmt: skip
_RIGID = ElementKind(
    "rigid", "rigid bodies", RigidElement, cable_kernel, ("r", "r_x"), "r_x",
    rigid=True, optional=True,
)  # fmt: skip

#: All kinds, by name.
KINDS: Mapping[str, ElementKind] = {kind.name: kind for kind in (_CABLE, _SHEAR, _QUINTIC, _RIGID)}


def kind_of(name: Any, what: str = "element") -> ElementKind:
    """The kind of a name.

    Parameters
    ----------
    name : str
    what : str
        What has it, for the message.

    Raises
    ------
    UnknownOptionError
        If there is no such kind.
    """
    found = KINDS.get(name) if type(name) is str else None
    return found or KINDS[one_of(what, name, KINDS)]


def flexible() -> tuple[str, ...]:
    """Names of the kinds that deform."""
    return tuple(name for name, kind in KINDS.items() if not kind.rigid)


def optional_beside(taken: Iterable[str]) -> frozenset[str]:
    """Names of the kinds that a solver may lack, and does if it takes these alone."""
    return frozenset(name for name, kind in KINDS.items() if kind.optional) - set(taken)


def with_statics() -> tuple[str, ...]:
    """Names of the kinds whose static equilibria are found."""
    return tuple(name for name, kind in KINDS.items() if kind.statics)


def moved_by(integrator: str) -> tuple[str, ...]:
    """Names of the kinds that ANC-TMM moves with an integrator.

    Raises
    ------
    UnknownOptionError
        If it is the integrator of no kind.
    """
    known = [name for kind in KINDS.values() for name in kind.integrators]
    if integrator not in known:
        raise unknown_option("integrator", integrator, dict.fromkeys(known))
    return tuple(name for name, kind in KINDS.items() if integrator in kind.integrators)


def check_kinds(
    cut: Mapping[str, tuple[int, str]],
    taken: Iterable[str],
    who: str,
    error: type[Exception] = DiscretisationError,
) -> None:
    """Refuse bodies of a kind that somebody does not take.

    Parameters
    ----------
    cut : mapping of body name to (int, str)
        Number and kind of the elements of every body, of `Discretisation.of`.
    taken : iterable of str
        Names of kinds.
    who : str
        Who takes only these, for the message.
    error : type of exception
        What to raise.

    Raises
    ------
    UnknownOptionError
        If a kind is none of `KINDS`.
    """
    taken = tuple(taken)
    for body, (_, name) in cut.items():
        kind = kind_of(name, f"element of body {body!r}")
        if kind.name not in taken:
            raise error(
                f"element is {name!r} for body {body!r}; {who} needs {' or '.join(map(repr, taken))} "
                f"(solver 'anctmm' has {kind.title} with {' or '.join(map(repr, kind.integrators))})"
            )
