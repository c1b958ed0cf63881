"""Stiffness and damping of elastic gears, from excitation and multisine runs.

What belongs here: the dynamics of an arm with elastic gears, its fit to recordings, and the
intervals of the result; a model of the links for a known stiffness. What does not belong here:
compensation with a known stiffness, and measurements of the tool's path. Start with
`gear_estimate.py`; for a known stiffness with `elastic_fit.py`.
"""
