"""Pictures of the trade: every setting with the front, and which error comes from the mesh and which from the step."""

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from studies.engine.running.trial import NO_BEAMS
from studies.engine.storage.files import file_name
from studies.engine.tables import error_text, text
from studies.report.error_pictures import ELEMENT_TITLES, RULE_SHADES, SHORT
from studies.report.plots import (
    INK,
    ON_DARK,
    ON_PALE,
    Picture,
    floor,
    front_line,
    legend_below,
    log_ticks,
    picture,
    solver_colour,
    solver_marker,
    work_precision,
)

#: How much is seen of settings that are not on the front.
FADED = 0.22
COLOURS = "viridis"
CONTROLLED = "error-controlled"
#: Colour and marker of kinds of steps that our solver alone has.
OWN_LOOKS = {
    CONTROLLED: ("#8c6d5a", "X"),
    SHORT["esdirk"]: ("#12245c", "P"),
    f"{SHORT['esdirk']}, {CONTROLLED}": ("#4a76c9", "X"),
}
#: Heights of a map, in: the lowest, and that below which the words beside its colours take two lines.
LOWEST, LOW = 2.2, 3.0
#: A step of a map, of the one before it, at most: more columns leave their texts no room.
APART = 0.6
SIGNS = {"mesh": "m", "step": "s", "both": "="}


def pictures(scene: str, frame: pd.DataFrame) -> list[Picture]:
    """All pictures of one scene's points."""
    sound = frame[(frame["error"] > 0) & (frame["cpu_s"] > 0)]
    if sound.empty:
        return []
    return [
        fronts(scene, sound.assign(error=sound["robust_error"])),
        *([split_map(scene, sound)] if len(_grid_rows(sound)) else []),
    ]


def fronts(scene: str, sound: pd.DataFrame) -> Picture:
    """Error against CPU time of all settings with the front; a panel an element."""
    lines = _styled(sound)
    best = sound[sound["excess"] == 1.0].sort_values("cpu_s")

    def draw(figure: Figure) -> None:
        families = [e for e in ELEMENT_TITLES if (lines["family"] == e).any()]
        panels = figure.subplots(1, len(families), squeeze=False, sharey=True, sharex=True)[0]
        for axes, family in zip(panels, families, strict=True):
            mine = lines[lines["family"] == family]
            work_precision(axes, mine, _title(mine, family), bounded=False)
            front_line(axes, best["cpu_s"], best["error"])
        low, high = panels[0].get_ylim()
        known = sound["reference_error"]
        # the reference's line and its words stand inside, also where all errors are below it
        panels[0].set_ylim(min(low, 0.4 * known.min()), max(high, 1.5 * known.max()))
        log_ticks(panels[0].yaxis, *panels[0].get_ylim())
        for axes, family in zip(panels, families, strict=True):
            floor(axes, sound.loc[sound["family"] == family, "reference_error"])
        for axes in panels[1:]:
            axes.set_ylabel("")
        legend_below(figure, list(panels), 3)

    caption = (
        f"{scene}: error against CPU time of all {len(sound)} settings that ended well; left and down is better. "
        "Line: the Pareto front of all elements together, and its settings; what another setting beats in both is "
        "faded. No error counts as smaller than with the tightest bound of Newton's iteration. Hollow: explicit. Grey: "
        "the reference's own uncertainty, below which an error says nothing. Point at a marker for its setting."
    )
    return picture(f"front_{file_name(scene)}", caption, draw, (7.6, 5.0))


def _title(rows: pd.DataFrame, family: str) -> str:
    """Of a panel: the element, where there are beams."""
    return "No beams" if _beamless(rows) else ELEMENT_TITLES[family]


def _beamless(rows: pd.DataFrame) -> bool:
    return bool((rows["elements"] == NO_BEAMS).all())


def _styled(sound: pd.DataFrame) -> pd.DataFrame:
    """Points with a look and a text: colour and marker show solver and kind of steps, hollow the explicit runs."""
    controlled = sound["tolerance"] > 0
    rule = sound["quadrature"].where(sound["quadrature"].isin(list(RULE_SHADES)), "")
    short = sound["integrator"].map(lambda i: SHORT.get(i, i))
    fourth = sound["integrator"] == "esdirk"
    kind = short.mask(controlled, (short + ", ").where(fourth, "") + CONTROLLED)
    looks = [
        OWN_LOOKS.get(k, (solver_colour(s), solver_marker(s)))
        for s, k in zip(sound["solver"], kind, strict=True)
    ]
    return sound.assign(
        label=sound["solver"] + ", " + kind,
        colour=[look[0] for look in looks],
        marker=[look[1] for look in looks],
        hollow=sound["integrator"] == "zhai",
        alpha=sound["excess"].eq(1.0).map({True: 1.0, False: FADED}),
        tip=[_tip(line, str(r)) for line, r in zip(sound.to_dict("records"), rule, strict=True)],
    )  # fmt: skip


def _tip(line: Mapping[Any, Any], rule: str) -> str:
    step = f"Δt {text(line['dt'])} s" if line["dt"] == line["dt"] else f"tolerance {text(line['tolerance'])}"
    element = " ".join(p for p in (str(line["element"]), rule) if p)
    beams = "" if line["elements"] == NO_BEAMS else f", {line['elements']} {element}"
    return (
        f"{line['solver']}, {SHORT.get(str(line['integrator']))}{beams}, {step}: "
        f"error {error_text(line)} (from {line['error_from']}), {1e3 * float(str(line['cpu_s'])):.3g} ms"
    )


def _grid_rows(sound: pd.DataFrame) -> pd.DataFrame:
    """Our implicit runs of fixed step and strictest Newton; of each element the quadrature most on the front."""
    ours = sound[
        (sound["solver"] == "anctmm") & (sound["integrator"] == "generalized-alpha") & (sound["dt"] > 0)
    ]
    kept = []
    for _, rows in ours.groupby("family", sort=False):
        near = rows[rows["excess"] <= max(1.0, rows["excess"].min())]
        counts = near["quadrature"].value_counts()
        chosen = rows[rows["quadrature"] == counts.index[0]]
        kept.append(chosen.sort_values("newton_tolerance").drop_duplicates(["elements", "dt"], keep="first"))
    return pd.concat(kept) if kept else ours


def split_map(scene: str, sound: pd.DataFrame) -> Picture:
    """Error over mesh and step, and which of the two it comes from; a panel an element."""
    rows = _grid_rows(sound)
    families = [e for e in ELEMENT_TITLES if (rows["family"] == e).any()]
    low, high = rows["error"].min(), rows["error"].max()
    norm = LogNorm(low, max(high, 1.01 * low))
    tall = [rows[rows["family"] == f]["elements"].nunique() for f in families]
    steps = _shown(sorted(rows["dt"].unique(), reverse=True))
    rows = rows[rows["dt"].isin(steps)]
    height = max(LOWEST, 0.8 + sum(0.5 + 0.36 * n for n in tall))

    def draw(figure: Figure) -> None:
        # one below the other, with the same columns: side by side their texts have no room
        panels = figure.subplots(len(families), 1, squeeze=False, sharex=True, height_ratios=tall)[:, 0]
        for axes, family in zip(panels, families, strict=True):
            _map(axes, rows[rows["family"] == family], steps, norm)
            mine = rows[rows["family"] == family]
            rule = mine["quadrature"].iloc[0]
            axes.set_title(
                _title(mine, family) + ("" if rule in ("-", "full") or _beamless(mine) else f", {rule}")
            )
        panels[-1].set_xlabel("time step (ms)")
        shades = mpl.cm.ScalarMappable(norm, COLOURS)
        bar = figure.colorbar(shades, ax=list(panels), fraction=0.05, pad=0.02)
        bar.set_label("relative error:{}the darker the better".format("\n" if height < LOW else " "))
        bar.ax.minorticks_off()
        bar.outline.set_visible(False)  # type: ignore[operator]

    where = "the step" if _beamless(rows) else "mesh and step"
    source = (
        "m: from the mesh (refine it), s: from the step (shorten it), =: from both. Empty: not tried. Of steps that "
        "are close to each other one is shown. The cheapest way to an error is where m meets s."
    )
    caption = (
        f"{scene}: error of implicit ANC–TMM (Newton to 1e-7) over {where}, and below it the CPU time in ms."
    )
    if not _beamless(rows):
        caption = f"{caption} {source}"
    return picture(f"mesh_step_{file_name(scene)}", caption, draw, (7.6, height))


def _shown(steps: list[float]) -> list[float]:
    """Of steps from long to short those that have room in a map: each well below the one before."""
    shown: list[float] = []
    for step in steps:
        if not shown or step <= APART * shown[-1]:
            shown.append(step)
    return shown


def _ms(cpu_s: float) -> str:
    return f"{1e3 * cpu_s:.2g}" if cpu_s < 0.0995 else f"{1e3 * cpu_s:.0f}"


def _map(axes: Axes, rows: pd.DataFrame, steps: list[float], norm: LogNorm) -> None:
    meshes = list(dict.fromkeys(rows.sort_values("dofs")["elements"]))
    grid = rows.pivot(index="elements", columns="dt", values="error").reindex(index=meshes, columns=steps)
    colours = mpl.colormaps[COLOURS]
    axes.pcolormesh(grid.to_numpy(float), norm=norm, cmap=colours, edgecolor=INK, linewidth=0.4)
    for line in rows.to_dict("records"):
        x, y = steps.index(line["dt"]) + 0.5, meshes.index(line["elements"]) + 0.5
        red, green, blue, _ = colours(norm(line["error"]))
        ink = ON_PALE if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else ON_DARK
        words = error_text(line, form=".0e").replace("e-0", "e−").replace(" ", "")
        sign = SIGNS.get(line["error_from"], "")
        axes.text(x, y - 0.16, f"{words} {sign}", ha="center", va="center", fontsize=7.5, color=ink)
        axes.text(x, y + 0.22, _ms(line["cpu_s"]), ha="center", va="center", fontsize=7, color=ink)
    axes.set_xticks(np.arange(len(steps)) + 0.5, [f"{1e3 * s:g}" for s in steps])
    axes.set_yticks(np.arange(len(meshes)) + 0.5, ["" if mesh == NO_BEAMS else mesh for mesh in meshes])
    axes.set_ylabel("elements" if len(meshes) > 1 else "")
    axes.grid(False)
    axes.invert_yaxis()  # as a table: finer downwards, shorter to the right
    axes.tick_params(length=0)
