"""Natural modes of a scene, and their frequencies as functions of a spin."""

from anctmm.small_motions.campbell import Campbell, campbell
from anctmm.small_motions.modal import Modes
from anctmm.small_motions.modes import modes

__all__ = ["Campbell", "Modes", "campbell", "modes"]
