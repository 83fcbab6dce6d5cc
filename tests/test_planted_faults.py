"""The faults that `planted.py` plants can be planted: what they change stands where they look for it."""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TABLE = tomllib.loads((Path(__file__).parent / "helpers" / "planting" / "planted_faults.toml").read_text())


@pytest.mark.parametrize("file", TABLE)
def test_each_fault_changes_one_place_of_its_file(file):
    source = (ROOT / file).read_text()
    for fault in TABLE[file]["faults"]:
        assert source.count(fault["old"]) == 1, fault["old"]
        assert ast.dump(ast.parse(source.replace(fault["old"], fault["new"]))) != ast.dump(ast.parse(source))
