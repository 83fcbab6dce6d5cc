"""Memory that a run will need, estimated before it starts."""

import os
from contextlib import suppress
from math import ceil
from pathlib import Path

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.errors import MemoryLimitError
from anctmm.model.scene import Scene

#: Bytes of a number, and of energies and time of an output; series of an output: coordinates and two rates.
NUMBER, ENERGIES, HISTORIES = 8, 64, 3
#: Runs that take less are not looked at: every machine has so much.
SMALL = 1 << 26
#: Part of the free memory that a run that is advised instead would take.
ADVISED = 0.8


def check_memory(
    scene: Scene,
    run: Discretisation,
    each: float,
    outputs: int | None = None,
    kept_each: float = HISTORIES * NUMBER,
    pair: float = 0.0,
) -> None:
    """Refuse a run that takes more memory than is free.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    each : float
        Bytes that the solver takes for each coordinate, without histories.
    outputs : int, optional
        States that are kept; those of the run without it.
    kept_each : float
        Bytes that are kept of each coordinate at an output.
    pair : float
        Bytes that the solver takes for each pair of coordinates.

    Raises
    ------
    MemoryLimitError
        Naming the figures, and the output interval or mesh that would do.
    """
    cut = run.of(scene)
    nodes = sum(elements + 1 for elements, _ in cut.values())
    size = nodes * scene.dim * max((len(kind_of(kind).vectors) for _, kind in cut.values()), default=0)
    kept = run.steps // run.stride + 2 if outputs is None else outputs
    system, output = size * (each + pair * size), size * kept_each + ENERGIES
    total = system + kept * output
    free = None if total <= SMALL else free_memory()
    if free is None or total <= free:
        return
    left = ADVISED * free - system
    if left < 2 * output:
        most = max(1, int(ADVISED * free * nodes / (system + 2 * output)))
        advice = f"a coarser mesh is needed, of about {most} nodes at most"
    elif outputs is None:
        interval = ceil(run.steps / max(1, int(left / output) - 2)) * run.exact_dt
        advice = f"output_dt of {interval:.6g} s or more, or a coarser mesh, is needed"
    else:
        advice = f"at most about {int(left / output)} outputs, or a coarser mesh, are needed"
    raise MemoryLimitError(
        f"scene {scene.name!r} with {nodes} nodes and {kept} outputs takes about {in_bytes(total)} of memory, "
        f"{in_bytes(kept * output)} of them for the outputs, and {in_bytes(free)} are free; {advice}"
    )


def free_memory() -> float | None:
    """Bytes that this process may still allocate; None if the system does not report it."""
    known = []
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        known += [1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable")]
    with suppress(OSError, ValueError):  # "max": no limit
        group = Path("/sys/fs/cgroup")
        limit, taken = ((group / name).read_text() for name in ("memory.max", "memory.current"))
        known.append(max(0.0, float(int(limit) - int(taken))))
    if not known:
        with suppress(OSError, ValueError, AttributeError):
            known.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    with suppress(ImportError, OSError, ValueError):
        import resource

        limited, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limited != resource.RLIM_INFINITY:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            known.append(max(0.0, float(limited - pages * os.sysconf("SC_PAGE_SIZE"))))
    return min(known) if known else None


def in_bytes(size: float) -> str:
    """A size in the unit that suits it."""
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 1e3:
            return f"{size:.3g} {unit}"
        size /= 1e3
    return f"{size:.3g} PB"
