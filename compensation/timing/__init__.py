"""Timing of a path: the fastest motion that the torques of a model allow.

Independent of velocity loops, cells and files. Begin with `timed_path.py`; decision 0043 has the
reasons.
"""
