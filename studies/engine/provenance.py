"""Where a number comes from: the machine and the versions that made it."""

import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

LIBRARIES = ("anctmm", "numpy", "scipy", "numba", "exudyn", "pyelastica", "opensees")
#: Of this package only what takes part in a run: editing a picture must not repeat an hour of runs.
#: (A scene is part of a run's key by its value.)
RUN_MODULES = ("engine/runner.py", "engine/timing.py")


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
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    return found


def stamp() -> str:
    """Machine and versions in one line."""
    m = machine()
    parts = [m["processor"], f"{m['cores']} cores", m["system"], f"Python {m['python']}"]
    return ", ".join(parts + [f"{name} {v}" for name, v in versions().items()])


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown processor"
