"""Recordings to mean periods: periods, smoothing, alignment of plate and axes.

Nothing is estimated here. Begin with `periods.py`.
"""
