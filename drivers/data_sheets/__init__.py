"""Data sheets (EDS) of CiA 402 drives: comparison with what rid-daq needs, and proposed keys.

No module contacts a drive. Begin with `eds_check.py`.
"""
