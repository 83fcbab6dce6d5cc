"""Settings that a solver may choose at the same mesh and step, from its capabilities: for runs, tables and scripts."""

import ast
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.solvers import registry

#: Options by name and value: data, that has a hash.
Given = tuple[tuple[str, Any], ...]
NONE = "-"


def choices_of(solver: str) -> Sequence[tuple[Given, Given]]:
    """Every choice of a solver's implicit runs: fields of the discretisation, and keyword arguments of its own.

    The first has the tightest bounds of the iteration.

    Raises
    ------
    UnknownSolverError, PluginError
        If the solver is not registered, or cannot be loaded.
    """
    shared = {f.name for f in fields(Discretisation) if f.init}
    choices = registry.offer_of(registry.load(solver)).choices
    return [
        (
            tuple((k, v) for k, v in choice.items() if k in shared),
            tuple((k, v) for k, v in choice.items() if k not in shared),
        )
        for choice in choices
    ]


def written(own: Given) -> str:
    """Keyword arguments as Python writes them, for a table; "-" without any."""
    return ", ".join(f"{name}={value!r}" for name, value in own) or NONE


def read(text: str) -> Given:
    """Keyword arguments of such a text; their values are literals.

    Raises
    ------
    ValueError
        If it is none.
    """
    if text == NONE:
        return ()
    try:
        call = ast.parse(f"f({text})", mode="eval").body
    except SyntaxError:
        call = None
    if not isinstance(call, ast.Call) or call.args or any(k.arg is None for k in call.keywords):
        raise ValueError(f"{text!r} is no list of keyword arguments")
    return tuple((str(k.arg), ast.literal_eval(k.value)) for k in call.keywords)
