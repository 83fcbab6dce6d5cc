"""Finished work on disk, and where a number comes from: files, store, sources, machine and versions."""
