"""Velocity loops measured with multisines, their fits, and the cascade of all loops of an axis.

This package describes the response of a drive; the other packages of `compensation` compute
commands. Begin with `velocity_loop.py`; decision 0025 gives the reasons.
"""
