"""Parts that all studies share: runs, store, sweeps, tables, times."""
