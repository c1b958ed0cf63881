"""Velocity loops measured with multisines, their fits, and the cascade of all loops of an axis.

This package describes the response of a drive; the other packages compute commands. Begin with
`velocity_loop.py`; decision 0025 has the reasons.
"""
