"""Output directory of a study: its tables and pictures, with the machine and checksums."""

from pathlib import Path

from studies.engine.storage.files import write_checksums
from studies.engine.study import Result
from studies.engine.tables import write_machine, write_table
from studies.report.plots import write_picture


def write(result: Result, out: Path) -> Path:
    """Write a result's tables and pictures to `<out>/<study>/` and return that directory."""
    folder = out / result.name
    folder.mkdir(parents=True, exist_ok=True)
    for table in result.tables:
        write_table(table, folder)
    for picture in result.pictures:
        write_picture(picture, folder)
    write_machine(folder)
    write_checksums(folder, [f"{table.name}.csv" for table in result.tables])
    return folder
