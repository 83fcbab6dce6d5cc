"""A run as a script: scene and discretisation written in the public interface, to be copied and changed."""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from math import pi, sqrt
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError
from anctmm.model.scene import Pin, Probe, Scene, Weld
from anctmm.model.sections import Circle, Rectangle, Section
from studies.engine.choices import NONE

WIDTH = 100
#: Written even where they are the defaults: what a reader looks for first.
ALWAYS = {"Discretisation": ("element", "integrator", "t_end")}


class SnippetError(AnctmmError, ValueError):
    """Something cannot be written as code."""


def snippet(scene: Scene, run: Discretisation, solver: str, probes: Sequence[Probe], own: str = NONE) -> str:
    """A script that runs a scene and leaves `solution`.

    Parameters
    ----------
    scene : Scene
        Written out.
    run : Discretisation
    solver : str
        Registered name.
    probes : sequence of str or (body, fraction)
        Whose last places are printed.
    own : str
        Keyword arguments that only this solver has, as Python writes them; "-" without any.

    Raises
    ------
    SnippetError
        If the scene has a plain function, which has no text.
    """
    return _script([], f"scene = {code(scene)}", run, solver, probes, own)


def snippet_of_file(
    file: str, case: str, run: Discretisation, solver: str, probes: Sequence[Probe], own: str = NONE
) -> str:
    """A script that runs a case of a user's file and leaves `solution`; parameters as of `snippet`."""
    imports = ["from studies.cases import find_case"]
    return _script(
        imports, f"scene = find_case({_text(file)}, {_text(case)}).scene", run, solver, probes, own
    )


def _script(
    imports: Sequence[str], scene: str, run: Discretisation, solver: str, probes: Sequence[Probe], own: str
) -> str:
    ours = solver == "anctmm"
    solve = "at.solve" if ours else f"registry.solver({_text(solver)})"
    imports = ["import anctmm as at", *([] if ours else ["from anctmm.solvers import registry"]), *imports]
    lines = [
        *imports, "", scene, f"run = {code(run)}", f"solution = {solve}(scene, run{'' if own == NONE else f', {own}'})",
        'print(f"{solution.status}: {1e3 * solution.cost.cpu_s:.3g} ms")',
        *(f"print({_place(probe)}, solution.position({_place(probe)})[-1])" for probe in probes),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _place(probe: Probe) -> str:
    return _text(probe) if isinstance(probe, str) else f"({_text(probe[0])}, {_number(probe[1])})"


def code(value: Any, indent: int = 0) -> str:
    """A scene, a discretisation or part of one as an expression, broken into lines where it is long."""
    if isinstance(value, Section):
        return _section(value)
    if isinstance(value, Pin | Weld):
        parts = [*map(code, value.ends), *(["grounded=True"] * (value.grounded and len(value.ends) > 1))]
        if isinstance(value, Weld) and value.angle is not None:
            parts.append(f"angle={code(value.angle)}")
        if isinstance(value, Weld) and value.stretch != "held":
            parts.append(f"stretch={code(value.stretch)}")
        return _call(type(value).__name__, parts, indent)
    if is_dataclass(value) and not isinstance(value, type):
        always: tuple[str, ...] = ALWAYS.get(type(value).__name__, ())
        # of a scene without beams nothing is cut
        if isinstance(value, Discretisation) and value.mesh is None:
            always = tuple(name for name in always if name != "element")
        shown = [f for f in fields(value) if f.init and f.repr]
        given = [f for f in shown if f.name in always or not _is_default(value, f)]
        parts = [f"{f.name}={code(getattr(value, f.name), indent + 4)}" for f in given]
        return _call(type(value).__name__, parts, indent)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_text(k)}: {code(v)}" for k, v in value.items()) + "}"
    if isinstance(value, tuple):
        if value and not isinstance(value[0], int | float):
            return _broken("[", [code(v, indent + 4) for v in value], "]", indent)
        return "(" + ", ".join(map(code, value)) + ")"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float):
        return _number(value)
    if value is None or isinstance(value, int):
        return repr(value)
    raise SnippetError(f"{value!r} has no text; numbers, texts and dataclasses of them are allowed")


def _section(section: Section) -> str:
    """By its diameter, or width and height, where these give the very same moments."""
    area, second = section.area, section.second_moment
    diameter, height = 2.0 * sqrt(area / pi), sqrt(12.0 * second / area)
    tried: tuple[tuple[type[Section], tuple[float, ...]], ...] = (
        (Circle, (diameter,)),
        (Rectangle, (area / height, height)),
    )
    for kind, sizes in tried:
        rounded = tuple(float(f"{size:.12g}") for size in sizes)
        if kind is type(section) and kind(*rounded) == section:
            return f"at.{kind.__name__}({', '.join(map(_number, rounded))})"
    return f"at.Section({area!r}, {second!r}, {section.fourth_moment!r})"


def _call(name: str, parts: list[str], indent: int) -> str:
    return _broken(f"at.{name}(", parts, ")", indent)


def _broken(opening: str, parts: list[str], closing: str, indent: int) -> str:
    line = opening + ", ".join(parts) + closing
    if len(line) + indent <= WIDTH and "\n" not in line:
        return line
    inside = " " * (indent + 4)
    return opening + "\n" + "".join(f"{inside}{p},\n" for p in parts) + " " * indent + closing


def _is_default(value: Any, field: Field[Any]) -> bool:
    given = getattr(value, field.name)
    # a default that only compares equal (a step "not given") is meant, too
    return field.default is not MISSING and type(given) is type(field.default) and given == field.default


def _number(value: float) -> str:
    """The shortest text of the very same number."""
    short = f"{value:g}".replace("e+0", "e").replace("e-0", "e-")
    return short if float(short) == value else repr(value)


def _text(value: str) -> str:
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
