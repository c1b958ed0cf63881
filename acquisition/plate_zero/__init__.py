"""Zero of a force plate, found by turning the first axis.

The code contains the complete method, from the motion to offsets and drift. Begin with
`plate_zero.py`.
"""
