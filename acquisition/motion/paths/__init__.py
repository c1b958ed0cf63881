"""Paths: curves with their lengths, and the speeds at which they can be driven.

The files do not depend on the other keys of a motion file or on the cycles of the task. Begin with
`segments.py`.
"""
