"""Clock of an imported recording: repeated rows, jitter, and rebuilt times.

The code in this folder works on arrays and reads no files. Begin with `judgement.py`. It drops the
repeated rows that `repeats.py` finds and estimates the times with `intervals.py`. It accepts these
times only if `left_out_joints.py` and `torque_test.py` confirm them.
"""
