"""Solutions as tables of pandas and data sets of xarray, with units."""

from collections.abc import Iterable
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import ResultError, shown
from anctmm.results.fields import RigidField

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]

#: What each place gives: suffixes of the columns, and its unit.
QUANTITIES = {"position": (("x", "y"), "m"), "velocity": (("vx", "vy"), "m/s"), "angle": (("angle",), "rad")}
ENERGIES = ("kinetic", "strain", "potential", "work", "dissipated")
#: Package that a function needs, and the extra of this one that brings it.
EXTRA = {"pandas": "files", "xarray": "files", "matplotlib": "plots"}


def needed(package: str, what: str) -> ModuleType:
    """An optional package.

    Raises
    ------
    ResultError
        If it is not installed, with the command that installs it.
    """
    try:
        return import_module(package)
    except ImportError as error:
        extra = EXTRA[package.partition(".")[0]]
        raise ResultError(f"{what} needs {package}: pip install 'anctmm[{extra}]' ({error})") from error


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
    pandas = needed("pandas", "to_frame")
    columns: dict[str, Array] = {}
    if isinstance(probes, str):
        raise ResultError(
            f"probes are {shown(probes)}; a list of places is needed, such as [{shown(probes)}]"
        )
    probes = list(probes)
    for probe, label in zip(probes, _labels(probes), strict=True):
        for quantity, (suffixes, unit) in QUANTITIES.items():
            try:
                found = getattr(solution, quantity)(probe)
            except ResultError:
                continue
            parts = found.reshape(len(found), len(suffixes)).T
            columns |= {f"{label} {s} ({unit})": part for s, part in zip(suffixes, parts, strict=True)}
    columns |= {f"{name} energy (J)": getattr(solution.energy, name) for name in ENERGIES if name != "work"}
    columns["work (J)"] = solution.energy.work
    index = pandas.Index(solution.t, name="load factor" if solution.static else "t (s)")
    return pandas.DataFrame(columns, index=index)


def _labels(probes: list[Any]) -> list[str]:
    """Places as the beginnings of columns' names: with six digits, or all if two would be equal."""
    short = [probe if isinstance(probe, str) else "{} {:g}".format(*probe) for probe in probes]
    return [
        label if short.count(label) == 1 or isinstance(probe, str) else f"{probe[0]} {float(probe[1])!r}"
        for probe, label in zip(probes, short, strict=True)
    ]


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
    xarray = needed("xarray", "to_dataset")
    if not isinstance(points, int | np.integer) or points < 2:
        raise ResultError(f"points is {shown(points)}; a whole number of 2 or more is needed")
    fractions = np.linspace(0.0, 1.0, points)
    names = [name for name, field in solution.fields.items() if not isinstance(field, RigidField)]
    time = "load_factor" if solution.static else "t"
    coordinates = {time: solution.t, "body": names, "fraction": fractions, "axis": ["x", "y"]}
    if not names:
        del coordinates["body"], coordinates["fraction"]
    variables: dict[str, Any] = {}
    for quantity, (suffixes, unit) in QUANTITIES.items() if names else ():
        try:
            parts = [getattr(solution, quantity)(name, fractions) for name in names]
        except ResultError:
            continue
        axes = (time, "body", "fraction") + (("axis",) if len(suffixes) > 1 else ())
        variables[quantity] = (axes, np.stack(parts, axis=1), {"units": unit})
    for name, field in solution.fields.items():
        if isinstance(field, RigidField):
            for quantity, (suffixes, unit) in QUANTITIES.items():
                axes = (time, "axis") if len(suffixes) > 1 else (time,)
                try:
                    series = getattr(solution, quantity)(f"{name}.center")
                except ResultError:
                    continue
                variables[f"{quantity}_{name}"] = (axes, series, {"units": unit})
    for name in ENERGIES:
        variables[f"energy_{name}"] = (time, getattr(solution.energy, name), {"units": "J"})
    about = {"scene": solution.scene.name, "solver": solution.solver, "status": str(solution.status)}
    found = xarray.Dataset(variables, coordinates, about)
    found[time].attrs["units"] = "1" if time == "load_factor" else "s"
    return found  # type: ignore[no-any-return]
