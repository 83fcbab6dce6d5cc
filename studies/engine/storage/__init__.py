"""Finished work on disk, and the origin of numbers: files, store, sources, machine and versions."""
