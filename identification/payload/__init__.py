"""Payloads: ten columns, three procedures, a verdict with intervals.

From two runs to a body; sessions stand in `rid_daq/jobs`. Begin with `procedures.py`, then
`verdict.py`; decision 0018 says why.
"""
