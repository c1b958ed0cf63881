"""Velocity loops measured by multisines and fitted; the cascade that they make.

What a drive does to a command; what to command stands in the rooms after. Begin with
`velocity_loop.py`; decision 0025 says why.
"""
