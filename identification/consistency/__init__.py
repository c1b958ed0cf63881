"""Whether a robot with such parameters can exist, and the closest one that can.

Physics of rigid bodies alone: no data. Begin with `pseudo_inertia.py`; decision 0013 says why.
"""
