"""Old place."""

from studies.engine.runner import Outcome
from studies.engine.trials import not_installed

__all__ = ["Outcome", "not_installed"]
