"""What ANC-TMM cannot do, by feature of `anctmm.model.needs.MECHANISMS`: it refuses scenes that need it."""

from anctmm.model.needs import MECHANISMS, WITH

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
#: What brings constraints that are driven or not linear: the method of fourth order would be one of second there.
CONSTRAINED = ("rigid-bodies", "driven-guides", "moving-guides", "driven-welds", "free-welds")
LACKING = frozenset(MECHANISMS) - DONE | {WITH.join(("esdirk", feature)) for feature in CONSTRAINED}
