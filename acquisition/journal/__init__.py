"""Journals on disk, as MCAP files: cycles, force plate, drive monitor and imported recordings.

This package converts between bytes and rows; `acquisition/session` writes those of a cell. Begin
with `mcap_writer.py`; decision 0004 has the reasons.
"""
