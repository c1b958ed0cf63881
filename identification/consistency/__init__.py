"""Physical consistency of parameters, and the closest physically consistent robot.

The input of this folder is an `Estimate`; it reads no recordings. Start with `pseudo_inertia.py`;
decision 0013 gives the reasons.
"""
