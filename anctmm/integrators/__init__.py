"""Time integration, statics, natural modes, stability limits, and what a run keeps."""
