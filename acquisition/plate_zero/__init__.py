"""The force plate's zero, found by turning the first axis.

A method of its own, from its motion to offsets and drift. Begin with `plate_zero.py`.
"""
