"""One run of one case: its results and their uncertainty."""
