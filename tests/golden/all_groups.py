"""All groups: importing a module registers its groups."""

from importlib import import_module

from tests.golden.answers import GROUPS

__all__ = ["GROUPS"]
MODULES = "connectors elements endings equilibria joints mechanisms published small_motions"

for module in MODULES.split():
    import_module(f"tests.golden.{module}")
