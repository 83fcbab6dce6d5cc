"""Old place."""

from studies.engine.files import atomic_write, check_writable, file_name, file_names

__all__ = ["atomic_write", "check_writable", "file_name", "file_names"]
