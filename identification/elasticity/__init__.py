"""Stiffness and damping of elastic gears, from excitation and multisine runs.

What belongs here: the dynamics of an arm with elastic gears, its fit to recordings, and the
intervals of the result. What does not belong here: the use of a known stiffness (`compensation`),
and measurements of the tool's path. Start with `gear_estimate.py`.
"""
