"""Time integration, statics, stability limits, and what a run keeps."""
