"""The cyclic task: the process that moves the robot cycle by cycle and brings it to rest.

During the cycles, nothing is written to a log or a file. Begin with `cyclic_task.py`, then
`stop_sequence.py`. The checks that decide if a motion may continue are in
`acquisition/supervision`.
"""
