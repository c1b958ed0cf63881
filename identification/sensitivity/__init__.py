"""Accuracy of a payload session before it is executed, from simulations.

Start with `monte_carlo.py`.
"""
