"""Solutions as files of VTK's XML format: a time series that ParaView opens (vtk.org, "VTK File Formats").

Each beam becomes a polyline of points along its axis, with displacement and, where the solver keeps them, velocity.
"""

from collections.abc import Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.results.fields import RigidField

Array = NDArray[np.float64]

#: VTK's number for a cell of connected lines.
POLYLINE = 4


def to_vtk(solution: Any, folder: str | PathLike[str], points: int = 21) -> Path:
    """Write a file for each output, and one that lists them with their times.

    Parameters
    ----------
    solution : Solution
    folder : path
        Made if it is not there.
    points : int
        Along each beam, its ends among them; 2 or more.

    Returns
    -------
    Path
        The list, "<scene>.pvd": the file to open.

    Raises
    ------
    ResultError
        If `points` is no whole number of 2 or more.
    OutputError
        If files cannot be written.
    """
    if not isinstance(points, int | np.integer) or points < 2:
        raise ResultError(f"points is {shown(points)}; a whole number of 2 or more is needed")
    fractions = np.linspace(0.0, 1.0, points)
    names = [name for name, field in solution.fields.items() if not isinstance(field, RigidField)]
    path = np.concatenate([solution.position(name, fractions) for name in names], axis=1)
    fields = {"displacement": path - path[:1]}
    with suppress(ResultError):
        fields["velocity"] = np.concatenate([solution.velocity(name, fractions) for name in names], axis=1)
    stem = "".join(c if c.isalnum() or c in "-_." else "_" for c in solution.scene.name) or "scene"
    target, listing = Path(folder), xml.Element("VTKFile", type="Collection", version="0.1")
    collection = xml.SubElement(listing, "Collection")
    try:
        target.mkdir(parents=True, exist_ok=True)
        for k, t in enumerate(solution.t):
            name = f"{stem}_{k:05d}.vtu"
            _grid(path[k], points, {key: values[k] for key, values in fields.items()}).write(target / name)
            xml.SubElement(collection, "DataSet", timestep=repr(float(t)), part="0", file=name)
        xml.ElementTree(listing).write(target / f"{stem}.pvd")
    except OSError as error:
        raise OutputError(f"folder {str(target)!r} cannot be written to: {reason(error)}") from error
    return target / f"{stem}.pvd"


def _grid(points: Array, each: int, fields: Mapping[str, Array]) -> xml.ElementTree:
    """An unstructured grid of polylines of `each` points."""
    root = xml.Element("VTKFile", type="UnstructuredGrid", version="0.1", byte_order="LittleEndian")
    lines = len(points) // each
    piece = xml.SubElement(
        xml.SubElement(root, "UnstructuredGrid"),
        "Piece",
        NumberOfPoints=str(len(points)),
        NumberOfCells=str(lines),
    )
    data = xml.SubElement(piece, "PointData", Vectors="displacement")
    for name, values in fields.items():
        _array(data, name, values)
    _array(xml.SubElement(piece, "Points"), "Points", points)
    cells = xml.SubElement(piece, "Cells")
    _numbers(cells, "connectivity", np.arange(len(points)))
    _numbers(cells, "offsets", each * np.arange(1, lines + 1))
    _numbers(cells, "types", np.full(lines, POLYLINE))
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
