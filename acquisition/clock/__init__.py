"""The clock of a recording from elsewhere: repeated rows, jitter, and rebuilt times.

No files and no maps. Begin with `judgement.py`: it drops the rows that `repeats.py` finds, has
`intervals.py` estimate the times, and accepts them only if `left_out.py` and `torque_test.py` do.
"""
