"""Features of `anctmm.model.needs.MECHANISMS` that ANC-TMM lacks: scenes that need them are refused."""

from anctmm.model.needs import MECHANISMS

#: What it does.
DONE = {
    "springs",
    "rotational-springs",
    "driven-springs",
    "laws",
    "interior-joints",
    "interior-loads",
    "follower-forces",
    "line-loads",
    "rigid-bodies",
    "point-masses",
    "sliders",
    "prismatic-joints",
    "driven-guides",
    "moving-guides",
    "driven-welds",
    "free-stretch",
    "free-welds",
    "own-joints",
}
LACKING = frozenset(MECHANISMS) - DONE
