"""Physical consistency of parameters, and the closest physically consistent robot.

This folder contains only rigid-body physics, no data. Start with `pseudo_inertia.py`; decision 0013
gives the reasons.
"""
