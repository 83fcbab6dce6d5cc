"""Solutions as tables of pandas and data sets of xarray, with units."""

from collections.abc import Iterable, Iterator
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import ResultError, shown
from anctmm.model.checks.parts import check_plane
from anctmm.model.places import written
from anctmm.results.fields import RigidField
from anctmm.validation import several

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]

#: What each place gives: suffixes of the columns, and its unit.
QUANTITIES = {"position": (("x", "y"), "m"), "velocity": (("vx", "vy"), "m/s"), "angle": (("angle",), "rad")}
ENERGIES = ("kinetic", "strain", "potential", "work", "dissipated")
#: Package that a function needs, and the extra of this one that brings it.
EXTRA = {"pandas": "files", "xarray": "files", "meshio": "files", "matplotlib": "plots"}


def needed(package: str, what: str) -> ModuleType:
    """An optional package; ResultError with the command that installs it if it is not installed."""
    try:
        return import_module(package)
    except ImportError as error:
        extra = EXTRA[package.partition(".")[0]]
        raise ResultError(f"{what} needs {package}: pip install 'anctmm[{extra}]' ({error})") from error


def check_points(points: object) -> None:
    """Refuse a number of points along a beam that is no whole number of 2 or more, by ResultError."""
    if not isinstance(points, int | np.integer) or points < 2:
        raise ResultError(f"points is {shown(points)}; a whole number of 2 or more is needed")


def _quantities(solution: Any, *place: Any) -> Iterator[tuple[str, Array]]:
    """Name and series of each quantity of a place that the solution has."""
    for quantity in QUANTITIES:
        try:
            yield quantity, getattr(solution, quantity)(*place)
        except ResultError:
            continue


def to_frame(solution: Any, probes: Iterable[Any]) -> "pd.DataFrame":
    """Motion of places as a table: one row for each output, columns such as "arm.end x (m)".

    Parameters
    ----------
    solution : Solution
    probes : iterable of str or (str, float)

    Returns
    -------
    pandas.DataFrame
        Index "t (s)", for a static solution "load factor". The last columns are the energies, J. Velocities and angles
        are missing if the solver does not store them, and angles of point masses always.

    Raises
    ------
    ResultError
        If pandas is not installed.
    """
    check_plane(solution.scene, "tables")
    pandas = needed("pandas", "to_frame")
    columns: dict[str, Array] = {}
    for probe in map(written, several("probes are", probes, "a list of places is needed", ResultError)):
        label = probe if isinstance(probe, str) else f"{probe[0]} {float(probe[1]):.12g}"
        for quantity, found in _quantities(solution, probe):
            suffixes, unit = QUANTITIES[quantity]
            parts = found.reshape(len(found), len(suffixes)).T
            columns |= {f"{label} {s} ({unit})": part for s, part in zip(suffixes, parts, strict=True)}
    columns |= {f"{name} energy (J)": getattr(solution.energy, name) for name in ENERGIES if name != "work"}
    columns["work (J)"] = solution.energy.work
    index = pandas.Index(solution.t, name="load factor" if solution.static else "t (s)")
    return pandas.DataFrame(columns, index=index)


def to_dataset(solution: Any, points: int = 21) -> "xr.Dataset":
    """Motion of all bodies as a data set, ready for NetCDF (`.to_netcdf(path)`).

    Parameters
    ----------
    solution : Solution
    points : int
        Number of equally spaced places along each beam, including its ends; 2 or more.

    Returns
    -------
    xarray.Dataset
        Variables "position", "velocity", "angle" (t, body, fraction[, axis]) of the beams; "position_plate" (t, axis)
        and so on of a rigid body "plate"; the energies. Each has an attribute "units"; attributes of the data set are
        scene, solver and status.

    Raises
    ------
    ResultError
        If xarray is not installed, or `points` is no whole number of 2 or more.
    """
    check_plane(solution.scene, "data sets")
    xarray = needed("xarray", "to_dataset")
    check_points(points)
    fractions = np.linspace(0.0, 1.0, points)
    rigid = [name for name, field in solution.fields.items() if isinstance(field, RigidField)]
    beams = [name for name in solution.fields if name not in rigid]
    time = "load_factor" if solution.static else "t"
    coordinates = {time: solution.t, "axis": ["x", "y"]}
    variables: dict[str, Any] = {}
    of_beams = [dict(_quantities(solution, name, fractions)) for name in beams]
    of_rigid = {name: dict(_quantities(solution, f"{name}.center")) for name in rigid}
    if beams:
        coordinates |= {"body": beams, "fraction": fractions}
    for quantity, (suffixes, unit) in QUANTITIES.items():
        axes = ("axis",) if len(suffixes) > 1 else ()
        if beams and all(quantity in found for found in of_beams):
            series = np.stack([found[quantity] for found in of_beams], axis=1)
            variables[quantity] = ((time, "body", "fraction", *axes), series, {"units": unit})
        for name, found in of_rigid.items():
            if quantity in found:
                variables[f"{quantity}_{name}"] = ((time, *axes), found[quantity], {"units": unit})
    for name in ENERGIES:
        variables[f"energy_{name}"] = (time, getattr(solution.energy, name), {"units": "J"})
    about = {"scene": solution.scene.name, "solver": solution.solver, "status": str(solution.status)}
    made = xarray.Dataset(variables, coordinates, about)
    made[time].attrs["units"] = "1" if solution.static else "s"
    return made  # type: ignore[no-any-return]
