"""Journals on disk: rows and headers of cycles, plate and monitor, as MCAP.

Bytes and rows; who writes when stands in `acquisition/session`. Begin with `mcap_writer.py`;
decision 0004 says why.
"""
