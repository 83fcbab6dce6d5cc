"""Natural modes of a scene, and their frequencies as functions of a spin."""

from anctmm.integrators.modes.campbell import Campbell, campbell
from anctmm.integrators.modes.modes import modes
from anctmm.integrators.modes.shapes import Modes

__all__ = ["Campbell", "Modes", "campbell", "modes"]
