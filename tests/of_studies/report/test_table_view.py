"""What is shown of a table, on the page and in the terminal."""

from pathlib import Path

import pandas as pd
import pytest

from studies.engine.tables import Table
from studies.report.table_view import view

KEPT = sorted((Path(__file__).parents[3] / "reports").rglob("*.csv"))


def columns(frame: pd.DataFrame) -> list[str]:
    return [column.label for column in view(Table("name", "Title", frame)).columns]


def test_a_value_with_its_digits_stands_for_its_numbers():
    frame = pd.DataFrame({"value": [1.25, 2.5], "uncertainty": 0.01, "unit": "m", "digits": ["1.25", "2.50"]})
    assert columns(frame) == ["digits"]


def test_a_count_of_digits_stands_beside_its_numbers():
    frame = pd.DataFrame({"found": [1.25, 2.5], "uncertainty": [0.01, 0.02], "unit": "m", "digits": [3, 4]})
    assert len(columns(frame)) == 4


@pytest.mark.parametrize("file", KEPT, ids=[f"{path.parent.name}/{path.name}" for path in KEPT])
def test_every_kept_table_can_be_shown(file):
    frame = pd.read_csv(file)
    assert len(view(Table(file.stem, file.stem, frame)).rows) == len(frame)
