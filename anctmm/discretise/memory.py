"""Memory that a run will need, estimated before it starts."""

import os
from contextlib import suppress
from math import ceil
from pathlib import Path
from typing import NamedTuple

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.junctions.couplings import coupled_connectors, divided_at, rows_of
from anctmm.elements.kinds import kind_of
from anctmm.errors import MemoryLimitError
from anctmm.model.scene import Force, Scene

#: Bytes of a number, and of energies and time of an output.
NUMBER, ENERGIES = 8, 64
#: What an output keeps of each coordinate: itself, its velocity and its acceleration.
HISTORIES = 3
#: Runs that take less are not looked at: every machine has so much.
SMALL = 1 << 26
#: Bytes of a connector whose places are kept, and of each place where it divides a beam: as measured.
KEPT, DIVIDED = 5e3, 11e3
#: Part of the free memory that a run that is advised instead would take.
ADVISED = 0.8


class Couplings(NamedTuple):
    """What couples distant nodes.

    Parameters
    ----------
    rows : int
        Rows of two square matrices, at most.
    kept : float
        Bytes that kept places take.
    """

    rows: int = 0
    kept: float = 0.0


#: Of explicit steps.
NONE = Couplings()


def check_memory(
    scene: Scene,
    run: Discretisation,
    each: float,
    pair: float = 0.0,
    outputs: int | None = None,
    kept_each: float = HISTORIES * NUMBER,
    coupled: Couplings = NONE,
) -> None:
    """Refuse a run that takes more memory than is free.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    each, pair : float
        Bytes that the solver takes for each coordinate, without histories, and for each pair of coordinates.
    outputs : int, optional
        States that are kept; those of the run without it.
    kept_each : float
        Bytes that are kept of each coordinate at an output.
    coupled : Couplings
        Of distant nodes.

    Raises
    ------
    MemoryLimitError
        Naming the figures, and the output interval or mesh that would do.
    """
    cut = run.of(scene)
    nodes = sum(elements + 1 for elements, _ in cut.values())
    rows = coordinates_of_node(run, scene)
    kept = run.steps // run.stride + 2 if outputs is None else outputs
    size = rows * nodes
    border = 2 * NUMBER * coupled.rows**2 + coupled.kept
    system, output = size * (each + pair * size) + border, size * kept_each + ENERGIES
    total = system + kept * output
    if total <= SMALL:
        return
    free = free_memory()
    if free is None or total <= free:
        return
    left = ADVISED * free - system
    if border > 0.5 * total:
        advice = (
            f"connectors between bodies, and forces that follow their place, take {in_bytes(border)} of them; fewer "
            f"are needed, or integrator='zhai', which takes no such room"
        )
    elif left < 2 * output:
        most = max(1, int(ADVISED * free * nodes / (system + 2 * output)))
        advice = f"a coarser mesh is needed, of about {most} nodes at most"
    elif outputs is None:
        stride = ceil(run.steps / max(1, int(left / output) - 2))
        interval = stride * run.exact_dt
        advice = f"output_dt of {interval:.6g} s or more, or a coarser mesh, is needed"
    else:
        advice = f"at most about {int(left / output)} outputs, or a coarser mesh, are needed"
    raise MemoryLimitError(
        f"scene {scene.name!r} with {nodes} nodes and {kept} outputs takes about {in_bytes(total)} of memory, "
        f"{in_bytes(kept * output)} of them for the outputs, and {in_bytes(free)} are free; {advice}"
    )


def couplings_of(scene: Scene, run: Discretisation) -> Couplings:
    """Couplings of distant nodes: of connectors between bodies, and of forces that follow their place."""
    kept = coupled_connectors(scene, run)
    rows = sum(rows_of(connector) for n, connector in enumerate(scene.connectors) if n not in kept)
    followers = sum(isinstance(load, Force) and load.follower for load in scene.loads)
    return Couplings(rows + followers, KEPT * len(kept) + DIVIDED * len(divided_at(scene, run, kept)))


def coordinates_of_node(run: Discretisation, scene: Scene) -> int:
    """Coordinates that each node has in the arrays of a run: those of the kind that has most."""
    return 2 * max((len(kind_of(kind).vectors) for _, kind in run.of(scene).values()), default=0)


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
