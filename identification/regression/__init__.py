"""Least squares, Huber weights and cluster-robust intervals, whatever the equations.

No robot: matrices in, estimates and covariances out. Begin with `least_squares.py`.
"""
