"""What every study shares: runs, store, sweeps, tables, times."""
