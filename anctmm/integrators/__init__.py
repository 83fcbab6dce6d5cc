"""Time integration, statics, natural modes, stability limits, and the output of runs."""
