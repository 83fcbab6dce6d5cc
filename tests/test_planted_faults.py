"""The faults that `planted.py` plants can be planted: what they change stands where they look for it."""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TABLE = tomllib.loads((Path(__file__).parent / "helpers" / "planting" / "planted_faults.toml").read_text())
#: Each is a part of the solver in which some small scene must see a fault.
KINDS = {
    "elements", "transfer", "recursion", "integrators", "statics", "rigid", "masses", "damping", "drives", "loads",
    "error control", "divergence checks", "connectors", "laws", "mechanisms",
}  # fmt: skip


def test_the_table_has_faults_of_every_kind():
    faults = [fault for entries in TABLE.values() for fault in entries["faults"]]
    assert {fault["kind"] for fault in faults} == KINDS
    assert len(faults) >= 60


@pytest.mark.parametrize("file", TABLE)
def test_each_fault_changes_one_place_of_its_file(file):
    source = (ROOT / file).read_text()
    for fault in TABLE[file]["faults"]:
        assert source.count(fault["old"]) == 1, fault["old"]
        assert ast.dump(ast.parse(source.replace(fault["old"], fault["new"]))) != ast.dump(ast.parse(source))
