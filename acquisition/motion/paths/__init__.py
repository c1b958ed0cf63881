"""Paths: curves measured by their length, and how fast they may be driven.

Nothing here knows a motion file's other keys or a cycle of the task. Begin with `segments.py`.
"""
