"""Old place."""

from studies.engine.provenance import machine, stamp, versions

__all__ = ["machine", "stamp", "versions"]
