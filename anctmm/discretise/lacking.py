"""What ANC-TMM cannot do yet, by feature of `anctmm.model.needs.MECHANISMS`: it refuses scenes that need it."""

from anctmm.model.needs import MECHANISMS

LACKING = frozenset(MECHANISMS)
