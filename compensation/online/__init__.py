"""Feedforward of a path that another program sends during the motion.

The compiled kernels run in every cycle. Begin with `online.py`; decision 0027 gives the reasons.
"""
