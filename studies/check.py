"""Public names for your own scenes in `anctmm check`, see `studies.regression`."""

from studies.regression.scenes import Static, Watch

__all__ = ["Static", "Watch"]
