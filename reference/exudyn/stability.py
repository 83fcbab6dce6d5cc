"""Stability of an equilibrium found by Exudyn: eigenvalues of the system as linearised by Exudyn itself."""

from importlib import import_module
from typing import Any

import numpy as np
import scipy

from anctmm.model.scene import Torque
from anctmm.results.checks.stability import unstable
from anctmm.results.status import Status
from reference.exudyn.model import Model

#: Coordinates up to which the system is linearised: Exudyn projects it by a dense singular value decomposition.
MANY = 1_500


def stability_status(exu: Any, model: Model, factor: float) -> Status:
    """Status of the equilibrium in which the static solver has left a model, under a load factor.

    Where Exudyn cannot tell the status is "ok", and its message says that the stability is not known, and why.
    """
    size = model.mbs.systemData.ODE2Size()
    if size > MANY:
        return _unknown(f"it has {size} coordinates, and at most {MANY} are linearised")
    if not model.beams.constant_torques and any(_moment(load) for load in _torques(model)):
        return _unknown("Exudyn's tangent leaves out that of torques")
    import_module("exudyn.solver")  # adds what follows to Exudyn's systems
    kinds, data = exu.ConfigurationType, model.mbs.systemData
    data.SetSystemState(data.GetSystemState(kinds.Current), kinds.Initial)
    M, K, _ = model.mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True)[:3]
    if not K.size:
        return Status()
    values = scipy.linalg.eigh(0.5 * (K + K.T), M, eigvals_only=True)
    rounding = np.finfo(float).eps * len(values) * float(np.abs(values).max())
    if float(np.abs(values).min()) <= rounding:
        return _unknown("an eigenvalue is no more than rounding: of a mechanism, or of a very fine mesh")
    negative = int((values < 0.0).sum())
    return unstable(factor, negative, None, None, 0.0) if negative else Status()


def _torques(model: Model) -> list[Torque]:
    return [load for load in model.scene.loads if isinstance(load, Torque)]


def _moment(load: Torque) -> float:
    return float(load.value(0.0)) if callable(load.value) else float(load.value)


def _unknown(why: str) -> Status:
    return Status("ok", f"stability not known: {why}")
