"""Estimation of payloads: ten columns, four procedures, a verdict with intervals.

This folder leads from runs to a payload; sessions are in `rid_daq/operations/payload`. Start with
`procedures.py`, then `verdict.py`; decision 0018 gives the reasons.
"""
