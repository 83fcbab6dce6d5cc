"""The setting that costs least for an error, chosen from the measured trade, and a script that runs it."""
