"""Least squares, robust weights and honest intervals, whatever the equations.

No robot: matrices in, estimates and covariances out. Begin with `least_squares.py`.
"""
