"""A simulated CiA 402 drive: objects, states, ramps, timeouts, faults.

The caller passes frames and times to the drive; it has no bus and reads no clock. Begin with
`drive.py`.
"""
