"""Journals on disk: rows and headers of cycles, force plate and drive monitor, as MCAP files.

This package converts between bytes and rows; `acquisition/session` writes them. Begin with
`mcap_writer.py`; decision 0004 has the reasons.
"""
