"""Origin of a number: the machine, the versions and the commit that computed it."""

import hashlib
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

LIBRARIES = ("anctmm", "numpy", "scipy", "numba", "exudyn", "pyelastica", "opensees")
#: Packages of this project, beside each other.
ROOT = Path(__file__).parents[2]
PACKAGES = ("anctmm", "reference", "studies")
#: Environment variable that names this machine in the place of its network name.
NAMED = "ANCTMM_MACHINE"


@cache
def machine() -> dict[str, str]:
    """Processor, cores, system and interpreter."""
    file = Path("/proc/cpuinfo")
    lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": next(iter(models), platform.processor()) or "unknown processor",
        "cores": str(os.cpu_count()), "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }  # fmt: skip


@cache
def versions() -> dict[str, str]:
    """Versions of the libraries that compute; "missing" where one is not installed."""
    return {name: next((d.version for d in distributions(name=name)), "missing") for name in LIBRARIES}


@cache
def sources(*packages: str) -> str:
    """Digest of the Python files of some packages of this project."""
    digest = hashlib.sha256()
    for package in packages or PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def commit() -> str:
    """Commit of the code, "-dirty" where files of it were changed since; a digest of the sources without a checkout."""
    try:
        head = _git("rev-parse", "--short=12", "HEAD") if (ROOT / ".git").exists() else ""
        changed = _git("status", "--porcelain", "--", *PACKAGES, "pyproject.toml") if head else ""
    except (OSError, subprocess.SubprocessError):
        head = changed = ""
    return f"{head}{'-dirty' if changed else ''}" if head else f"sources {sources()}"


def name() -> str:
    """Name of this machine: what the environment variable ANCTMM_MACHINE says, or that in its network."""
    return os.environ.get(NAMED) or platform.node() or "unnamed"


def software() -> str:
    """Interpreter and versions in one line."""
    return ", ".join([f"Python {machine()['python']}", *(f"{k} {v}" for k, v in versions().items())])


def stamp() -> str:
    """Commit, machine and versions in one line."""
    m = machine()
    return f"commit {commit()}, {m['processor']}, {m['cores']} cores, {m['system']}, {software()}"


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, timeout=30)
    return done.stdout.strip()
