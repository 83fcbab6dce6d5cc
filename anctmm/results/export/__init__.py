"""Export of solutions: files, tables, pictures."""
