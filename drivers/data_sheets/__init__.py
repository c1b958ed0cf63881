"""EDS files of CiA 402 drives: comparison with the required objects, and keys.

No module contacts a drive. Begin with `eds_check.py`.
"""
