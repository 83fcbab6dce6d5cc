"""What ANC-TMM cannot do, by feature of `anctmm.model.needs.MECHANISMS`: it refuses scenes that need it."""

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
}
LACKING = frozenset(MECHANISMS) - DONE
