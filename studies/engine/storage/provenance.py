"""Origin of a number: the machine and the versions that computed it."""

import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

LIBRARIES = ("anctmm", "numpy", "scipy", "numba", "exudyn", "pyelastica", "opensees")
#: Names this machine in the place of its own name, which may change where machines are rented or made anew.
NAMED = "ANCTMM_MACHINE"


@cache
def machine() -> dict[str, str]:
    """Processor, cores, system and interpreter."""
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }


@cache
def versions() -> dict[str, str]:
    """Versions of the libraries that compute; "missing" where one is not installed."""
    found = {}
    for library in LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:
            found[library] = "missing"
    return found


def name() -> str:
    """Name of this machine: what the environment variable ANCTMM_MACHINE says, or that in its network."""
    return os.environ.get(NAMED) or platform.node() or "unnamed"


def software() -> str:
    """Interpreter and versions in one line: what, beside its own code, the result of a run depends on."""
    found = [f"Python {machine()['python']}", *(f"{library} {v}" for library, v in versions().items())]
    return ", ".join(found)


def timed_on() -> str:
    """What a time depends on beside its own code: the machine, by name, and its software."""
    return f"{name()}, {stamp()}"


def stamp() -> str:
    """Machine and versions in one line."""
    m = machine()
    parts = [m["processor"], f"{m['cores']} cores", m["system"], f"Python {m['python']}"]
    return ", ".join(parts + [f"{library} {v}" for library, v in versions().items()])


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown processor"
