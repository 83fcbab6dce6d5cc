"""What a solution becomes outside of Python: files, tables, pictures."""
