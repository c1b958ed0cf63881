"""Zero of a force plate, found by turning the first axis.

Complete method, from its motion to offsets and drift. Begin with `plate_zero.py`.
"""
