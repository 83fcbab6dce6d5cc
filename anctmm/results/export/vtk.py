"""Solutions as files of VTK's XML format: a time series that ParaView opens (vtk.org, "VTK File Formats").

Each beam becomes a polyline of points along its axis, each rigid body one of its outline, each mass a vertex. Points
have their displacement and, if the solver stores it, velocity.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.model.bodies import Beam
from anctmm.model.rigid_bodies import CENTER, RigidBody
from anctmm.results.export.shapes import outline

Array = NDArray[np.float64]

#: VTK's numbers for a cell of one point, and of connected lines.
VERTEX, POLYLINE = 1, 4


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
    if not isinstance(points, int | np.integer) or points < 2:
        raise ResultError(f"points is {shown(points)}; a whole number of 2 or more is needed")
    if not len(solution.t):
        raise ResultError(f"scene {solution.scene.name!r} has no outputs to write: {solution.status}")
    places = [_places(solution.scene.body(name), points) for name in solution.fields]
    sizes, probes = [len(cell) for cell in places], [place for cell in places for place in cell]
    path = np.stack([solution.position(*place) for place in probes], axis=1)
    fields = {"displacement": path - path[:1]}
    with suppress(ResultError):
        fields["velocity"] = np.stack([solution.velocity(*place) for place in probes], axis=1)
    stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in solution.scene.name) or "scene"
    target, listing = Path(folder), xml.Element("VTKFile", type="Collection", version="0.1")
    collection = xml.SubElement(listing, "Collection")
    try:
        target.mkdir(parents=True, exist_ok=True)
        for k, t in enumerate(solution.t):
            name = f"{stem}_{k:05d}.vtu"
            _grid(path[k], sizes, {key: values[k] for key, values in fields.items()}).write(target / name)
            xml.SubElement(collection, "DataSet", timestep=repr(float(t)), part="0", file=name)
        xml.ElementTree(listing).write(target / f"{stem}.pvd")
    except OSError as error:
        raise OutputError(f"folder {str(target)!r} cannot be written to: {reason(error)}") from error
    return target / f"{stem}.pvd"


def _places(body: Any, points: int) -> list[tuple[str, Any]]:
    """Body and fraction, or key, of the points that a body is drawn through."""
    if isinstance(body, Beam):
        return [(body.name, x) for x in np.linspace(0.0, 1.0, points)]
    keys = outline(body) if isinstance(body, RigidBody) else [CENTER]
    return [(body.name, key) for key in keys]


def _grid(points: Array, sizes: Sequence[int], fields: Mapping[str, Array]) -> xml.ElementTree:
    """An unstructured grid of cells of connected lines, or of one point, each with its number of points."""
    root = xml.Element("VTKFile", type="UnstructuredGrid", version="0.1", byte_order="LittleEndian")
    piece = xml.SubElement(
        xml.SubElement(root, "UnstructuredGrid"),
        "Piece",
        NumberOfPoints=str(len(points)),
        NumberOfCells=str(len(sizes)),
    )
    data = xml.SubElement(piece, "PointData", Vectors="displacement")
    for name, values in fields.items():
        _array(data, name, values)
    _array(xml.SubElement(piece, "Points"), "Points", points)
    cells = xml.SubElement(piece, "Cells")
    _numbers(cells, "connectivity", np.arange(len(points)))
    _numbers(cells, "offsets", np.cumsum(sizes))
    _numbers(cells, "types", np.where(np.array(sizes) == 1, VERTEX, POLYLINE))
    return xml.ElementTree(root)


def _array(parent: xml.Element, name: str, vectors: Array) -> None:
    """Vectors of the plane, as VTK wants them, of space; every digit is kept."""
    found = xml.SubElement(
        parent, "DataArray", type="Float64", Name=name, NumberOfComponents="3", format="ascii"
    )
    found.text = "\n".join(f"{x!r} {y!r} 0.0" for x, y in vectors.tolist())


def _numbers(parent: xml.Element, name: str, numbers: NDArray[np.int64]) -> None:
    kind = "UInt8" if name == "types" else "Int64"
    xml.SubElement(parent, "DataArray", type=kind, Name=name, format="ascii").text = " ".join(
        map(str, numbers.tolist())
    )
