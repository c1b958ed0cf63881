"""The feedforward of a path that somebody sends while it is driven.

Its kernels run within the cycle. Begin with `online.py`; decision 0027 says why.
"""
