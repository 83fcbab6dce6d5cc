"""Exceptions and warnings. Every message names the thing, its value and what is allowed."""

import re
from collections.abc import Iterable
from itertools import islice
from reprlib import Repr
from typing import Never

from anctmm.raised import line_of


class AnctmmError(Exception):
    """Base class of the exceptions of this package."""


class SceneError(AnctmmError, ValueError):
    """The physics of a scene is wrong or inconsistent."""


class PropertyError(SceneError):
    """A physical property is not finite, has the wrong sign or is out of its range."""


class UnknownKindError(SceneError, TypeError):
    """A body, joint, load or other part of a scene is of an unknown kind, or of one that is not allowed there."""


class DegenerateBodyError(SceneError):
    """A body has no length."""


class DuplicateNameError(SceneError):
    """Two bodies have the same name."""


class UnknownNameError(SceneError, KeyError):
    """A body, a body end or a probe is not part of the scene."""

    def __str__(self) -> str:  # KeyError would print the repr of the message
        return str(self.args[0]) if self.args else ""


class TopologyError(SceneError):
    """The joints do not fit each other, or the bodies, or what a solver can do."""


class EndJoinedTwiceError(TopologyError):
    """A joint names one end twice."""


class RepeatedJointError(TopologyError):
    """A joint repeats a constraint of other joints."""


class ContradictingJointsError(TopologyError):
    """Joints contradict each other."""


class JointGapError(TopologyError):
    """The ends of a joint are not at one place, or their velocities differ."""


class CaseError(AnctmmError, ValueError):
    """A case, or a file of cases, cannot be used."""


class DiscretisationError(AnctmmError, ValueError):
    """Mesh, element, integrator or step cannot be used."""


class MeshError(DiscretisationError):
    """The mesh misses a body, names an unknown one or has no elements."""


class UnknownOptionError(DiscretisationError):
    """An element, quadrature, integrator or other option has an unknown name."""


class StepError(DiscretisationError):
    """The time step, run length or output interval is impossible."""


class StabilityError(StepError):
    """The time step lies above the stability limit of an explicit integrator."""


class MemoryLimitError(DiscretisationError, MemoryError):
    """A run needs more memory than is free."""


class SolverError(AnctmmError, RuntimeError):
    """A solver cannot start, because of the scene as discretised."""


class UnknownSolverError(AnctmmError, KeyError):
    """No solver is registered by this name."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class PluginError(SolverError):
    """A registered solver cannot be loaded, lacks a required function, or returns an invalid solution."""


class UnsupportedError(SolverError):
    """A solver lacks a feature that a scene or discretisation needs; its status is then "unsupported"."""


class ResultError(AnctmmError, ValueError):
    """A solution does not contain the requested result."""


class StartWarning(UserWarning):
    """Initial velocities that a joint, a drive or a rigid body cannot have are replaced by those that it can."""


class EquilibriumWarning(UserWarning):
    """Modes about a state that is no equilibrium."""


class OutputError(AnctmmError, OSError):
    """A file or directory cannot be written."""


def shown(value: object) -> str:
    """A value as one short line, whatever its `repr` does."""
    try:
        text = _SHORT.repr(value)
    except Exception:  # reprs of others may do anything
        return f"<{type(value).__name__} that cannot be shown>"
    return one_line(_ADDRESS.sub(r"\1", text))


def listed(names: Iterable[object]) -> str:
    """Names as text, the first few of many."""
    names = list(names)
    some = ", ".join(map(shown, islice(names, MANY)))
    return some if len(names) <= MANY else f"{some}, … ({len(names)} in all)"


def reason(error: BaseException) -> str:
    """Class and message of an exception in one short line, whatever its `str` does; and the user's line of it."""
    try:
        text = str(error)
    except Exception:
        text = ""
    name, line = type(error).__name__, line_of(error)
    message = one_line(f"{name}: {text}" if text else name)
    return message if line is None else f"{message} ({line})"


def one_line(text: str) -> str:
    """Text without line breaks, its middle left out where it is long."""
    text = " ".join(text.split()) if len(text.splitlines()) > 1 else text
    return text if len(text) <= LONG else f"{text[: LONG // 2]} … {text[-LONG // 4 :]}"


def unknown_kind(what: str, thing: Never, allowed: Iterable[type]) -> UnknownKindError:
    """What to raise where no case of a `match` is for a thing: mypy proves that every known kind has a case."""
    return UnknownKindError(
        f"{what} is {shown(thing)} of type {type(thing).__name__}; "
        f"allowed here are {', '.join(kind.__name__ for kind in allowed)}"
    )


def unknown_option(what: str, value: object, allowed: Iterable[str]) -> UnknownOptionError:
    """What to raise where a name is none of those allowed, or no case of a `match` is for it."""
    return UnknownOptionError(f"{what} is {shown(value)}; allowed are {', '.join(map(repr, allowed))}")


#: Where a function or another object stands in memory: it says nothing, and is another one in each run.
_ADDRESS = re.compile(r"(<[\w .<>'-]+?) at 0x[0-9a-fA-F]+(?=>)")
#: Characters of a value in a message, and names in a list, at most.
LONG, MANY = 240, 12
_SHORT = Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxlong, _SHORT.maxother = 4, 80, 60, LONG
_SHORT.maxtuple = _SHORT.maxlist = _SHORT.maxarray = _SHORT.maxdict = _SHORT.maxset = 8
