"""Memory that a run will need, estimated before it starts."""

import os
from contextlib import suppress
from pathlib import Path

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.errors import MemoryLimitError
from anctmm.model.scene import Scene

#: Bytes of a number, and of energies and time of an output; series of an output: coordinates and two rates, and half as
#: much again while they are checked.
NUMBER, ENERGIES, HISTORIES = 8, 64, 4.5


def check_memory(
    scene: Scene,
    run: Discretisation,
    each: float,
    outputs: int | None = None,
    kept_each: float = HISTORIES * NUMBER,
    pair: float = 0.0,
) -> None:
    """Refuse a run that takes more memory than is free, by a MemoryLimitError that names the figures.

    Parameters
    ----------
    scene, run
    each, pair : float
        Bytes that the solver takes for each coordinate, and for each pair of coordinates, without histories.
    outputs : int, optional
        States that are kept; those of the run without it.
    kept_each : float
        Bytes that are kept of each coordinate at an output.
    """
    cut = run.of(scene)
    nodes = sum(elements + 1 for elements, _ in cut.values())
    size = nodes * scene.dim * max((len(kind_of(kind).vectors) for _, kind in cut.values()), default=0)
    kept = run.steps // run.stride + 2 if outputs is None else outputs
    system, histories = size * (each + pair * size), kept * (size * kept_each + ENERGIES)
    free = free_memory()
    if free is None or system + histories <= free:
        return
    advice = "fewer outputs (a larger output_dt)" if histories > system else "a coarser mesh"
    total, kept_in, left = (f"{x / 1e9:.3g} GB" for x in (system + histories, histories, free))
    raise MemoryLimitError(
        f"scene {scene.name!r} with {nodes} nodes and {kept} outputs takes about {total} of memory, {kept_in} of them "
        f"for the outputs, and {left} are free; {advice} is needed"
    )


def free_memory() -> float | None:
    """Bytes that this process may still allocate, by the system and its control group; None if they do not say."""
    known = []
    with suppress(OSError, ValueError, AttributeError):
        known.append(float(os.sysconf("SC_AVPHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        known = [1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable")]
    with suppress(OSError, ValueError):  # "max": no limit
        group = Path("/sys/fs/cgroup")
        limit, taken = ((group / name).read_text() for name in ("memory.max", "memory.current"))
        known.append(max(0.0, float(int(limit) - int(taken))))
    return min(known, default=None)
