"""Paths: curves with their lengths, and the speeds at which they can be driven.

The code here does not depend on other keys of a motion file or on the cycle time. Begin with
`segments.py`.
"""
