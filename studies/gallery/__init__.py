"""A gallery: a dozen scenes of at most 25 lines, each with its picture and a number that is known.

`python -m studies.gallery` runs the scenes, and writes the pictures and the page of this folder.
"""
