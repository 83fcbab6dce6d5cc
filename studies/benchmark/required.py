"""What is required of speed, size and accuracy, beside what was found."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from studies.benchmark.additions import ELEMENTS, MOST_ADDED, PLAIN
from studies.benchmark.calls import AGAIN, MOST_BUILD
from studies.benchmark.first import EMPTY, LIST
from studies.benchmark.length import BASE
from studies.benchmark.peers import DENSE, OURS, SPARSE
from studies.benchmark.topology import LADDER
from studies.engine.measuring.clock import records
from studies.engine.tables import Table

#: Bounds of memory, bytes of an element; of a difference to a direct solver; of the ratio of times of two lengths.
MOST_BYTES, MOST_DIFFERENCE, MOST_RATIO = 1500.0, 1e-10, 1.5
#: Times of a tree's and a ladder's elements over a chain's, at most; of a first result by integrator, of a command, s.
MOST_TREE, MOST_LADDER, MOST_FIRST, MOST_LIST = 1.25, 3.0, {"zhai": 6.0, "generalized-alpha": 12.0}, 1.0


def requirements(frames: Mapping[str, pd.DataFrame], quick: bool) -> Table:
    """What is required of speed, size and accuracy, and what was found.

    Parameters
    ----------
    frames : mapping of table name to DataFrame
    quick : bool
        Whether lengths are those of a quick run.
    """
    rows = [
        *_explicit(frames["exudyn"]), *_equal_error(frames["equal_error"]), *_methods(frames["methods"]),
        *_length(frames["length"]), *_additions(frames["additions"]), *_calls(frames["calls"]),
        *_topology(frames["topology"]), *_direct(frames["direct"]), *_first(frames["first"]),
    ]  # fmt: skip
    frame = pd.DataFrame(rows)
    met = frame["found"] >= frame["required"]
    frame["met"] = met.where(frame["sense"] == "at least", frame["found"] <= frame["required"])
    frame = frame[["what", "found", "sense", "required", "goal", "met", "status"]]
    notes: tuple[str, ...] = (
        "Ratios with their required bounds; `goal` is the target. All values are from this run.",
    )
    if quick:
        notes += ("A quick run: lengths and repeats are smaller than those the requirements speak of.",)
    return Table("requirements", "Required and found", frame, notes)


def _line(what: str, found: float, required: float, goal: float, sense: str, status: str) -> dict[str, Any]:
    return {
        "what": what, "found": found, "sense": sense, "required": required, "goal": goal, "status": status,
    }  # fmt: skip


def _explicit(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"Exudyn / ANC-TMM, explicit, {r['scene']}, {r['elements']} elements",
            r["ratio"],
            7.0,
            12.0,
            "at least",
            r["status"],
        )
        for r in records(frame[frame["integrator"] == "zhai"])
    ]


def _equal_error(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"Exudyn / ANC-TMM, implicit, {r['scene']}, error {r['error']:g}",
            r["ratio_implicit"], 8.0, 15.0, "at least", r["status"],
        )
        for r in records(frame)
    ]  # fmt: skip


def _methods(frame: pd.DataFrame) -> list[dict[str, Any]]:
    bounds = {(DENSE, "2/8/2"): (40.0, 100.0), (DENSE, "8/32/8"): (400.0, float("nan"))}
    rows = []
    for r in records(frame[frame["method"] != OURS]):
        required, goal = bounds.get((r["method"], r["elements"]), (1.0, float("nan")))
        what = f"{r['method']} / ANC-TMM, explicit, four-bar {r['elements']}"
        rows.append(_line(what, r["ratio"], required, goal, "at least", r["status"]))
    return rows


def _length(frame: pd.DataFrame) -> list[dict[str, Any]]:
    lines = []
    longest = frame.groupby(["element", "integrator", "bodies"], sort=False).tail(1)
    for r in records(longest):
        what = f"{r['element']}, {r['integrator']}, {r['elements']} elements in {r['bodies']} bodies"
        time = f"time of an element and step / that at {BASE}: {what}"
        lines.append(_line(time, r["ratio"], MOST_RATIO, 1.0, "at most", r["status"]))
        size = f"bytes of an element: {what}"
        lines.append(_line(size, r["bytes"], MOST_BYTES, float("nan"), "at most", r["status"]))
    return lines


def _additions(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"step of {ELEMENTS} elements with {r['added']} / without: {r['integrator']}, {r['along']}",
            r["ratio"], 1.0 + MOST_ADDED, 1.0, "at most", r["status"],
        )
        for r in records(frame[frame["added"] != PLAIN])
    ]  # fmt: skip


def _calls(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"s that a call takes beside its steps: {r['scene']} again, {r['integrator']}",
            r["build_s"], MOST_BUILD, float("nan"), "at most", r["status"],
        )
        for r in records(frame[frame["call"] == AGAIN])
    ]  # fmt: skip


def _topology(frame: pd.DataFrame) -> list[dict[str, Any]]:
    lines = []
    for r in records(frame):
        which = f"{r['integrator']}, {r['joints']} {r['scene']} of {r['beams']} beams"
        most = MOST_LADDER if r["scene"] == LADDER else MOST_TREE
        status, nothing = r["status"], float("nan")
        lines.append(
            _line(
                f"time of an element and step / a chain's: {which}", r["ratio"], most, 1.0, "at most", status
            )
        )
        if r["integrator"] != "zhai":
            of_correction = f"time of an element and correction / a chain's: {which}"
            lines.append(_line(of_correction, r["ratio_iteration"], most, 1.0, "at most", status))
        beside = f"time of a step / that of {SPARSE}: {which}"
        lines.append(_line(beside, 1.0 / r["ratio_dae"], 1.0, nothing, "at most", status))
    return lines + _lengths_of_ladders(frame[frame["scene"] == LADDER])


def _lengths_of_ladders(frame: pd.DataFrame) -> list[dict[str, Any]]:
    lines = []
    for (integrator, joints), found in frame.groupby(["integrator", "joints"], sort=False):
        which = f"{integrator}, {joints} ladders of {found['beams'].min()} to {found['beams'].max()} beams"
        status = next((s for s in found["status"] if s != "ok"), "ok")
        ratios = {"step": found["ratio_length"]}
        if integrator != "zhai":
            ratios["correction"] = found["ratio_length_iteration"]
        for unit, values in ratios.items():
            what = f"time of an element and {unit}, the largest / the least: {which}"
            largest = float(values.max(skipna=False) / values.min(skipna=False))
            lines.append(_line(what, largest, MOST_RATIO, 1.0, "at most", status))
    return lines


def _first(frame: pd.DataFrame) -> list[dict[str, Any]]:
    lines = []
    for r in records(frame[(frame["kernels_before"] == EMPTY) | (frame["scene"] == LIST)]):
        command = r["scene"] == LIST
        what = LIST if command else f"first result, {r['integrator']}, {r['scene']}, no kernel kept"
        most = MOST_LIST if command else MOST_FIRST[r["integrator"]]
        lines.append(_line(f"{what}: wall time, s", r["wall_s"], most, float("nan"), "at most", r["status"]))
    return lines


def _direct(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        _line(
            f"accelerations less a banded direct solve's: {r['element']}, {r['elements']} elements "
            f"in {r['bodies']} bodies",
            r['difference'], MOST_DIFFERENCE, float("nan"), "at most", r['status'],
        )
        for r in records(frame[frame["what"] == "accelerations"])
    ]  # fmt: skip
