"""Timing of a path: the fastest motion that the torques of a model allow.

This package does not depend on velocity loops, cells or files. Begin with `timed_path.py`; decision
0043 gives the reasons.
"""
