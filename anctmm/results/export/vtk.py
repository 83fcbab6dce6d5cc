"""Solutions as files of VTK's XML format: a time series that ParaView opens (vtk.org, "VTK File Formats").

Each beam becomes a polyline of points along its axis, each rigid body one of its outline, each mass a vertex. Points
have their displacement and, if the solver stores it, velocity.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason
from anctmm.model.bodies import Beam
from anctmm.model.checks.space import check_plane
from anctmm.model.rigid_bodies import CENTER, RigidBody
from anctmm.results.export.shapes import outline
from anctmm.results.export.tables import check_points

Array = NDArray[np.float64]

#: VTK's numbers for a cell of one point, and of connected lines.
VERTEX, POLYLINE = 1, 4
GRID = """<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="{points}" NumberOfCells="{cells}">
<PointData Vectors="displacement">{fields}</PointData>
<Points>{places}</Points>
<Cells>{connectivity}{offsets}{types}</Cells>
</Piece></UnstructuredGrid></VTKFile>
"""
LISTING = '<VTKFile type="Collection" version="0.1"><Collection>\n{}\n</Collection></VTKFile>\n'


def to_vtk(solution: Any, folder: str | PathLike[str], points: int = 21) -> Path:
    """Write a file for each output, and one that lists them with their times.

    Parameters
    ----------
    solution : Solution
    folder : path
        Created if it does not exist.
    points : int
        Number of points along each beam, including its ends; 2 or more.

    Returns
    -------
    Path
        The list of files, "<scene>.pvd": the file to open.

    Raises
    ------
    ResultError
        If `points` is no whole number of 2 or more, or the solution has no outputs.
    OutputError
        If files cannot be written.
    """
    check_plane(solution.scene, "files for ParaView")
    check_points(points)
    if not len(solution.t):
        raise ResultError(f"scene {solution.scene.name!r} has no outputs to write: {solution.status}")
    places = [_places(solution.scene.body(name), points) for name in solution.fields]
    sizes, probes = [len(cell) for cell in places], [place for cell in places for place in cell]
    path = np.stack([solution.position(*place) for place in probes], axis=1)
    fields = {"displacement": path - path[:1]}
    with suppress(ResultError):
        fields["velocity"] = np.stack([solution.velocity(*place) for place in probes], axis=1)
    stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in solution.scene.name) or "scene"
    target, lines = Path(folder), []
    try:
        target.mkdir(parents=True, exist_ok=True)
        for k, t in enumerate(solution.t.tolist()):
            name = f"{stem}_{k:05d}.vtu"
            now = {key: values[k] for key, values in fields.items()}
            (target / name).write_text(_grid(path[k], sizes, now), encoding="utf-8")
            lines.append(f'<DataSet timestep="{t!r}" part="0" file="{name}"/>')
        (target / f"{stem}.pvd").write_text(LISTING.format("\n".join(lines)), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"folder {str(target)!r} cannot be written to: {reason(error)}") from error
    return target / f"{stem}.pvd"


def _places(body: Any, points: int) -> list[tuple[str, Any]]:
    """Body and fraction, or key, of the points that a body is drawn through."""
    if isinstance(body, Beam):
        return [(body.name, x) for x in np.linspace(0.0, 1.0, points)]
    keys = outline(body) if isinstance(body, RigidBody) else [CENTER]
    return [(body.name, key) for key in keys]


def _grid(points: Array, sizes: Sequence[int], fields: Mapping[str, Array]) -> str:
    """An unstructured grid of cells of connected lines, or of one point, each with its number of points."""
    return GRID.format(
        points=len(points),
        cells=len(sizes),
        fields="".join(_vectors(name, values) for name, values in fields.items()),
        places=_vectors("Points", points),
        connectivity=_numbers("connectivity", range(len(points))),
        offsets=_numbers("offsets", np.cumsum(sizes).tolist()),
        types=_numbers("types", [VERTEX if size == 1 else POLYLINE for size in sizes], "UInt8"),
    )


def _vectors(name: str, vectors: Array) -> str:
    """Vectors of the plane, as VTK wants them, of space; every digit is kept."""
    rows = "\n".join(f"{x!r} {y!r} 0.0" for x, y in vectors.tolist())
    return f'<DataArray type="Float64" Name="{name}" NumberOfComponents="3" format="ascii">{rows}</DataArray>'


def _numbers(name: str, numbers: Sequence[int], kind: str = "Int64") -> str:
    return f'<DataArray type="{kind}" Name="{name}" format="ascii">{" ".join(map(str, numbers))}</DataArray>'
