"""Feedforward of a path that another program sends during the motion.

The kernels run within the cycle. Begin with `online.py`; decision 0027 has the reasons.
"""
