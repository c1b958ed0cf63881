"""Clock of an imported recording: repeated rows, jitter, and rebuilt times.

The code in this folder works on arrays and reads no files. Begin with `judgement.py`. It drops the
repeated rows that `repeats.py` finds and estimates the times with `intervals.py`. It accepts these
times if `left_out_joints.py` confirms them and `torque_test.py` does not contradict them. If
`left_out_joints.py` cannot judge them, for example because only one joint moves, `torque_test.py`
must confirm them.
"""
