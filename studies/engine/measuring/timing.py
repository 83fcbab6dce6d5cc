"""Old place."""

from studies.engine.timing import in_turn, least, settled, undisturbed

__all__ = ["in_turn", "least", "settled", "undisturbed"]
