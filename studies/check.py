"""Public names for scenes of your own that `anctmm check` watches, see `studies.regression`."""

from studies.regression.scenes import Static, Watch

__all__ = ["Static", "Watch"]
