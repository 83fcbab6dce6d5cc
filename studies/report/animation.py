"""The motion of a scene in a few kilobytes: each body by few cubic pieces, as whole numbers, differences in time.

A piece is a Hermite cubic, which an SVG path draws exactly as a Bézier curve: the bent axis of an ANCF body.
Outlines of rigid bodies and springs are pieces without tangents, which are straight.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.scene import Scene
from anctmm.results.export.shapes import Shape, box, shapes_of, supports_of
from anctmm.results.solution import Solution
from studies.engine.pictures import Film

Array = NDArray[np.float64]

#: Numbers of pieces tried for a body, and the part of the picture's size that its axis may be wrong by.
PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24)
SMOOTH = 1e-3
#: Most pictures of an animation: what lies between is interpolated.
FRAMES = 61
#: Whole numbers across the picture.
GRAIN = 2000


def film(title: str, caption: str, layers: Mapping[str, Solution]) -> Film | None:
    """An animation of solutions of one scene; None if none of them is whole.

    Parameters
    ----------
    title, caption : str
    layers : mapping of label to Solution
        The first is the motion, others are drawn behind it.
    """
    whole = {label: s for label, s in layers.items() if s.status.ok and s.fields}
    if not whole:
        return None
    first = next(iter(whole.values()))
    frames = np.unique(np.linspace(0, len(first.t) - 1, min(FRAMES, len(first.t))).round().astype(int))
    drawn = {label: shapes_of(s) for label, s in whole.items()}
    every = [shape.points[frames].reshape(-1, 2) for shapes in drawn.values() for shape in shapes]
    low, high = box(np.concatenate(every))
    size = float((high - low).max()) or 1.0
    unit = size / GRAIN
    data = [
        [encoded(curve_of(whole[label], shape, frames, SMOOTH * size) / unit) for shape in shapes]
        for label, shapes in drawn.items()
    ]
    margin = round(0.06 * GRAIN)
    left, top = round(low[0] / unit) - margin, round(-high[1] / unit) - margin
    width, height = ((high - low) / unit).round().astype(int) + 2 * margin
    return Film(
        first.scene.name, title, caption, tuple(whole), float(first.t[-1]), (left, top, int(width), int(height)),
        supports(first.scene, unit), json.dumps({"frames": len(frames), "layers": data}, separators=(",", ":")),
        tuple((shape.kind, shape.name) for shapes in drawn.values() for shape in shapes),
    )  # fmt: skip


def curve_of(solution: Solution, shape: Shape, frames: NDArray[Any], wrong: float) -> Array:
    """What is drawn of a shape: the axis of a beam as `body_curve`, other lines straight from point to point."""
    if shape.kind == "beam":
        return body_curve(solution, shape.name, frames, wrong)
    points = shape.points[frames]
    if shape.kind == "mass":
        points = np.repeat(points, 2, axis=1)  # a line without length, whose round ends are seen
    return np.concatenate([points, np.zeros_like(points)], axis=2)


def body_curve(solution: Solution, body: str, frames: NDArray[Any], wrong: float) -> Array:
    """A beam's axis as Hermite pieces, few but no further than `wrong` (m) from the solution's axis.

    Returns
    -------
    ndarray, shape (frames, pieces + 1, 4)
        x, y, and a third of the tangent over a piece: what the control points of a Bézier curve are away.
    """
    for pieces in PIECES:
        curve = _pieces(solution, body, frames, pieces)
        if _distance(solution, body, frames, curve) <= wrong:
            break
    return curve


def encoded(curve: Array) -> list[Any]:
    """Whole numbers: the number of nodes, the first frame, the first step, then changes of the step: mostly small.

    y is turned downwards, as pictures have it.
    """
    flipped = curve * np.array([1.0, -1.0, 1.0, -1.0])
    whole = np.rint(flipped).astype(int).reshape(len(curve), -1)
    steps = np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1]))
    changes = np.concatenate([steps[:1], np.diff(steps[1:], axis=0, prepend=np.zeros_like(whole[:1]))])
    return [curve.shape[1], changes.ravel().tolist()]


def supports(scene: Scene, unit: float) -> tuple[tuple[str, int, int], ...]:
    """Where the scene is held by the ground."""
    return tuple(
        (support.kind, round(support.position[0] / unit), round(-support.position[1] / unit))
        for support in supports_of(scene)
    )


def _pieces(solution: Solution, body: str, frames: NDArray[Any], pieces: int) -> Array:
    fractions = np.linspace(0.0, 1.0, pieces + 1)
    d = 1e-4
    nodes = []
    for s in fractions:
        side = -1.0 if s > 1.0 - 2 * d else 1.0  # one-sided: the next piece begins at a node
        a, b, c = (solution.position(body, s + side * k * d)[frames] for k in (0, 1, 2))
        slope = side * (4.0 * b - 3.0 * a - c) / (2.0 * d)
        nodes.append(np.concatenate([a, slope / (3.0 * pieces)], axis=1))
    return np.stack(nodes, axis=1)


def _distance(solution: Solution, body: str, frames: NDArray[Any], curve: Array) -> float:
    """Largest distance of the pieces from the axis, at three places in each, m."""
    pieces, worst = curve.shape[1] - 1, 0.0
    for i in range(pieces):
        a, b = curve[:, i], curve[:, i + 1]
        control = (a[:, :2], a[:, :2] + a[:, 2:], b[:, :2] - b[:, 2:], b[:, :2])
        for x in (0.25, 0.5, 0.75):
            weights = ((1 - x) ** 3, 3 * x * (1 - x) ** 2, 3 * x * x * (1 - x), x**3)
            drawn = sum(w * c for w, c in zip(weights, control, strict=True))
            true = solution.position(body, (i + x) / pieces)[frames]
            worst = max(worst, float(np.linalg.norm(drawn - true, axis=1).max()))
    return worst
