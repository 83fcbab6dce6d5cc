"""Studies of the solvers, their commands, and what they share: runs, timings, tables, pictures, the results page."""
