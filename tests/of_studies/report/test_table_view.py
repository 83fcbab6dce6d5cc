"""What is shown of a table, on the page and in the terminal."""

from pathlib import Path

import pandas as pd
import pytest

from studies.engine.tables import Table, error_text, write_table
from studies.report.table_view import view
from studies.trade.choice import known_error

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


#: An error that is known, one below what its reference is known to, and one whose parts have another reference.
ERRORS = pd.DataFrame(
    {
        "setting": ["coarse", "fine"], "error": [4.25e-3, 7.7e-8], "robust_error": [4.25e-3, 9e-5],
        "reference_error": 1.8e-4, "step_error": [4e-3, 7.6e-8], "step_reference_error": 1e-9,
    }
)  # fmt: skip


def test_an_error_below_that_of_its_reference_is_shown_as_below_it(tmp_path):
    """7.7e-8 was told of a run whose reference is known to 1.8e-4. Files for programs keep the number."""
    table = Table("points", "All settings", ERRORS)
    shown = ["fine", "< 0.00018", "< 0.00018", "0.00018", "7.6e-08", "1e-09"]
    assert [text for text, _ in view(table).rows[1]] == shown
    assert view(table).rows[0][1][0] == "0.00425"
    assert all(column.numeric for column in view(table).columns[1:])
    write_table(table, tmp_path)
    assert "| " + " | ".join(shown) + " |" in (tmp_path / "points.md").read_text()
    assert "fine,7.7e-08,9e-05,0.00018" in (tmp_path / "points.csv").read_text()


def test_sentences_tell_an_error_below_that_of_its_reference_as_below_it():
    coarse, fine = ERRORS.to_dict("records")
    assert known_error(coarse) == "0.004 ± 0.0002"
    assert known_error(fine) == "< 0.0002"
    assert [error_text(line) for line in (coarse, fine)] == ["0.0043", "< 0.00018"]
    assert error_text(fine, "step_error", ".1g") == "8e-08"
