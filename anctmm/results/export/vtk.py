"""Solutions as a time series that ParaView opens.

Each beam becomes a polyline of points along its axis, each rigid body one of its outline, each mass a vertex. Points
have their displacement and, if the solver stores it, velocity.
"""

from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason
from anctmm.model.bodies import Beam
from anctmm.model.checks.parts import check_plane
from anctmm.results.export.shapes import outline
from anctmm.results.export.tables import check_points, needed

Array = NDArray[np.float64]

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
        If meshio is not installed, `points` is no whole number of 2 or more, or the solution has no outputs.
    OutputError
        If files cannot be written.
    """
    check_plane(solution.scene, "files for ParaView")
    check_points(points)
    if not len(solution.t):
        raise ResultError(f"scene {solution.scene.name!r} has no outputs to write: {solution.status}")
    meshio = needed("meshio", "to_vtk")
    places = [_places(solution.scene.body(name), points) for name in solution.fields]
    spans = list(pairwise(np.cumsum([0, *map(len, places)]).tolist()))
    cells = {
        "line": [(k, k + 1) for first, end in spans for k in range(first, end - 1)],
        "vertex": [(first,) for first, end in spans if end == first + 1],
    }
    series = dict(_series(solution, [place for body in places for place in body]))
    path = series.pop("position")
    stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in solution.scene.name) or "scene"
    target, lines = Path(folder), []
    try:
        target.mkdir(parents=True, exist_ok=True)
        for k, t in enumerate(solution.t.tolist()):
            fields = {"displacement": path[k] - path[0], **{name: x[k] for name, x in series.items()}}
            mesh = meshio.Mesh(path[k], [(kind, of) for kind, of in cells.items() if of], point_data=fields)
            mesh.write(target / f"{stem}_{k:05d}.vtu")
            lines.append(f'<DataSet timestep="{t!r}" part="0" file="{stem}_{k:05d}.vtu"/>')
        (target / f"{stem}.pvd").write_text(LISTING.format("\n".join(lines)), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"folder {str(target)!r} cannot be written to: {reason(error)}") from error
    return target / f"{stem}.pvd"


def _series(solution: Any, places: list[tuple[str, Any]]) -> Iterator[tuple[str, Array]]:
    """Positions of places and, if they are known, velocities, each (n, places, 3): VTK wants vectors of space."""
    with suppress(ResultError):
        for name, read in (("position", solution.position), ("velocity", solution.velocity)):
            found = np.stack([read(*place) for place in places], axis=1)
            yield name, np.pad(found, ((0, 0), (0, 0), (0, 1)))


def _places(body: Any, points: int) -> list[tuple[str, Any]]:
    """Body and fraction, or key, of the points that a body is drawn through."""
    if isinstance(body, Beam):
        return [(body.name, x) for x in np.linspace(0.0, 1.0, points)]
    return [(body.name, key) for key in outline(body)]
