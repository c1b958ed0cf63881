"""Least squares, Huber weights and cluster-robust intervals for any equations.

This folder contains no robots: its inputs are matrices, its outputs estimates and covariances.
Start with `least_squares.py`.
"""
