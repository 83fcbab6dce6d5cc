"""What ANC-TMM cannot do yet, by feature of `anctmm.model.needs.MECHANISMS`: it refuses scenes that need it."""

from anctmm.model.needs import MECHANISMS

#: What acts on beams: loads and connectors.
DONE = {
    "springs",
    "rotational-springs",
    "driven-springs",
    "laws",
    "interior-loads",
    "follower-forces",
    "line-loads",
}
LACKING = frozenset(MECHANISMS) - DONE
