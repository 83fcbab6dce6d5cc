"""What the hash of a kernel's code notices, and what not."""

import dis
import importlib
import linecache
import sys

import numba
import pytest
from samples import beam

import anctmm as at
from anctmm.integrators import zhai
from anctmm.integrators.implicit import system as implicit_system
from anctmm.jit.deferred import Deferred
from anctmm.jit.files import code_digest as code_digest_module
from anctmm.jit.files.code_digest import _globals, _own, code_digest, signature_text
from anctmm.jit.interpreting import interpreted
from anctmm.model.kept import forget_structures
from reference import global_dae
from reference.global_dae import runs  # noqa: F401 - its kernels are known from the beginning

pytestmark = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason="there are no kernels without a compiler"
)

#: A package with every way in which a kernel can depend on code elsewhere.
SOURCES = {
    "outer": '''
"""A docstring."""
import numpy as np
from PACKAGE import elements
from PACKAGE.choice import chosen
from PACKAGE.numbers import FACTOR, TABLE, UNUSED, Pair
from anctmm.jit.compiling import embedded, inlined, kernel

LOCAL = 3.0


@inlined
def square(x):
    """A docstring."""
    return x * x


@embedded
def cube(x):
    return x * square(x)


@kernel
def top(x, n):
    """A docstring."""
    total = 0.0  # a comment
    for i in range(n):
        total += cube(x[i]) + FACTOR * TABLE[1] + LOCAL + elements.force(x[i]) + chosen((0,), x[i])
    return Pair(total, np.sin(1.0))


@kernel
def other(x):
    return x


def plain(x):
    return top(x, 3)
''',
    "numbers": '''
from typing import NamedTuple

FACTOR = 2.0
TABLE = (1.0, 2.0)
UNUSED = 7.0


class Pair(NamedTuple):
    """A docstring."""

    first: float
    second: float
''',
    "elements": '''
from anctmm.jit.compiling import kernel


@kernel
def force(x):
    """A docstring."""
    return stretch(x) - 1.0


@kernel
def stretch(x):
    return 2.0 * x


@kernel
def moment(x):
    return 5.0 * x
''',
    "choice": '''
from anctmm.jit.compiling import chosen_by_types
from PACKAGE.more import one, two


def chosen(kinds, x):
    """A docstring."""
    return one(x)


@chosen_by_types(chosen)
def _chosen(kinds, x):
    def of_one(kinds, x):
        """A docstring."""
        return one(x)

    def of_two(kinds, x):
        return two(x)

    return (of_one, of_two)[kinds.count - 1]
''',
    "more": """
from anctmm.jit.compiling import kernel


@kernel
def one(x):
    return x + 1.0


@kernel
def two(x):
    return x + 2.0
""",
}


@pytest.fixture
def digest_of(tmp_path, monkeypatch):
    """Function: the package with one text in the place of another → digest of its kernel `top`."""
    made = []

    def forget():
        for module in [m for m in sys.modules if m.partition(".")[0] == "kernels_here"]:
            del sys.modules[module]
        linecache.clearcache()
        code_digest_module._source.cache_clear()

    def digest(module="outer", old="", new=""):
        made.append(tmp_path / str(len(made)))
        folder = made[-1] / "kernels_here"
        folder.mkdir(parents=True)
        for each, source in SOURCES.items():
            if each == module:
                assert old in source
                source = source.replace(old, new) if old else source
            (folder / f"{each}.py").write_text(source.replace("PACKAGE", "kernels_here"))
        monkeypatch.syspath_prepend(str(made[-1]))
        forget()
        outer = importlib.import_module("kernels_here.outer")
        assert outer.__file__.startswith(str(made[-1]))
        return code_digest(outer.top.py_func)

    yield digest
    forget()


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("outer", "", ""),
        ("outer", "A docstring", "Another docstring\n\n    of several lines."),
        ("outer", "  # a comment", ""),
        ("outer", "return x\n", "return 2 * x\n"),
        ("outer", "return top(x, 3)", "return top(x, 4)"),
        ("outer", "LOCAL = 3.0\n", "\n\n\nLOCAL = 6.0 / 2.0\n"),
        ("numbers", "UNUSED = 7.0", "UNUSED = 8.0"),
        ("numbers", "A docstring", "Another docstring"),
        ("elements", "A docstring", "Another docstring"),
        ("elements", "5.0 * x", "6.0 * x"),
        ("choice", "A docstring", "Another docstring"),
    ],
)
def test_what_the_machine_code_does_not_depend_on_changes_nothing(digest_of, module, old, new):
    assert digest_of(module, old, new) == digest_of()


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("outer", "total = 0.0", "total = 1.0"),
        ("outer", "x * x", "x + x"),
        ("outer", "x * square(x)", "x + square(x)"),
        ("outer", "LOCAL = 3.0", "LOCAL = 4.0"),
        ("outer", "@inlined", "@kernel"),
        ("outer", "+ LOCAL +", "- LOCAL +"),
        ("outer", "cube(x[i]) + FACTOR", "cube(x[i]) - FACTOR"),
        ("outer", "np.sin(1.0)", "np.cos(1.0)"),
        ("numbers", "FACTOR = 2.0", "FACTOR = 3.0"),
        ("numbers", "(1.0, 2.0)", "(1.0, 3.0)"),
        ("numbers", "FACTOR = 2.0", "FACTOR = 2"),
        ("numbers", "    first: float\n    second: float", "    second: float\n    first: float"),
        ("elements", "- 1.0", "- 2.0"),
        ("elements", "2.0 * x", "3.0 * x"),
        ("choice", "[kinds.count - 1]", "[2 - kinds.count]"),
        ("choice", "        return two(x)", "        return two(x) + 1.0"),
        ("more", "x + 1.0", "x + 3.0"),
        ("more", "x + 2.0", "x + 3.0"),
    ],
)
def test_what_the_machine_code_depends_on_changes_the_digest(digest_of, module, old, new):
    assert digest_of(module, old, new) != digest_of()


def test_types_of_one_name_are_told_apart_by_their_classes():
    kinds = [
        numba.types.NamedTuple((numba.float64,) * len(module.State._fields), module.State)
        for module in (zhai, implicit_system)
    ]
    texts = {signature_text((kind,)) for kind in kinds}
    assert len(texts) == 2
    matrix = numba.float64[:, ::1]
    assert signature_text((matrix,)) != signature_text((numba.float64[::1, :],))
    assert signature_text((matrix,)) != signature_text((matrix.copy(readonly=True),))
    assert signature_text((matrix, numba.none)) != signature_text((matrix, matrix))


def digests():
    """The digest of every kernel of the solver and of the global DAE, found anew."""
    _own.cache_clear()
    modules = [m for name, m in sys.modules.items() if name.partition(".")[0] in ("anctmm", "reference")]
    kernels = {id(one): one for m in modules for one in vars(m).values() if isinstance(one, Deferred)}
    return {(k.py_func.__module__, k.py_func.__qualname__): code_digest(k.py_func) for k in kernels.values()}


def test_what_a_process_has_computed_changes_no_digest():
    """Or every scene with a loop had kernels of its own, and a second process compiled them for nobody."""
    forget_structures()
    before = digests()
    assert len(before) > 100
    plates = [
        at.RigidBody(name, mass=1.0, inertia=0.1, center=center, points={"a": a, "b": b})
        for name, center, a, b in (
            ("p", (0.5, 0.5), (0.0, 0.0), (1.0, 1.0)),
            ("q", (1.5, 0.5), (1.0, 1.0), (2.0, 0.0)),
        )
    ]
    joints = [at.Pin("p.a", "one.start"), at.Pin("p.b", "q.a"), at.Pin("q.b", "one.end")]
    scene = at.Scene("loop", [beam("one", (0.0, 0.0), (2.0, 0.0)), *plates], joints, gravity=(0.0, -9.81))
    for integrator, dt in (("zhai", 1e-6), ("generalized-alpha", 1e-4)):
        run = {"mesh": 1, "integrator": integrator, "dt": dt, "t_end": 2 * dt}
        with interpreted():
            assert at.solve(scene, **run).status.ok
        assert global_dae.solve(scene, **run).status.ok
    assert digests() == before


@pytest.mark.parametrize("count", [0, 100, 300, 70000])
def test_an_attribute_is_no_global_of_the_same_name(count):
    """Names that code takes from its module are told as Python's own disassembler tells them."""
    place = {}
    exec(f"def f(x):\n    ({''.join(f'g{n}, ' for n in range(count))})\n    return x.loops + other\n", place)
    code = place["f"].__code__
    told = {one.argval for one in dis.get_instructions(code) if one.opname == "LOAD_GLOBAL"}
    assert set(_globals(code)) == told == {"other", *(f"g{n}" for n in range(count))}
