"""Paths: curves with their lengths, and the speeds at which they can be driven.

The segments have keys of a motion file; all other values, such as the cycle time, are arguments.
Begin with `segments.py`.
"""
