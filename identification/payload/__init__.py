"""Payloads: ten columns, three procedures, a verdict with intervals.

From two runs to a body; sessions are in `rid_daq/operations/payload`. Begin with `procedures.py`,
then `verdict.py`; decision 0018 says why.
"""
