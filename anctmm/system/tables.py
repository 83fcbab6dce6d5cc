"""What kernels get of a scene, and what is given at a time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.by_address import by_address
from anctmm.system.acting import Acting
from anctmm.system.elastic import Elements
from anctmm.system.matrix import Matrix
from anctmm.system.rows import Rows

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@by_address
class Driven(NamedTuple):
    """Vectors that drives prescribe, for kernels: Σ w b.

    Parameters
    ----------
    node, component : ndarray of int, shape (n,)
    start : ndarray of int, shape (n + 1,)
        Where the terms of each begin.
    signal : ndarray of int, shape (terms,)
    b : ndarray, shape (terms, dim)
    beam, element : ndarray of int, shape (k,)
        Elements next to driven nodes: their beam, and their first node.
    """

    node: Ints
    component: Ints
    start: Ints
    signal: Ints
    b: Array
    beam: Ints
    element: Ints


@by_address
class Tables(NamedTuple):
    """What kernels need of a scene.

    Parameters
    ----------
    elements, rows, acting, matrix, driven
    dead : ndarray, shape (rows of nodes, nodes)
        Gravity and constant forces, N.
    damped : ndarray of int, shape (2,)
        Whether forces depend on velocities, and whether those of materials do.
    calls : named tuple of int
        Addresses of compiled functions: see `anctmm.system.calls`.
    """

    elements: Elements
    rows: Rows
    acting: Acting
    matrix: Matrix
    driven: Driven
    dead: Array
    damped: Ints
    calls: Any


@by_address
class Inputs(NamedTuple):
    """What is given at each of n times.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    signals : ndarray, shape (n, signals, 3)
        Value, rate and acceleration of each; number 0 is always 1.
    loads : ndarray, shape (n, loads, dim)
        Values of the loads that vary.
    free : ndarray, shape (n, connectors, 2)
        Free lengths and angles, and their rates.
    """

    t: Array
    signals: Array
    loads: Array
    free: Array
