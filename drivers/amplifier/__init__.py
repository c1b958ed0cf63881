"""The force plate's charge amplifier on a serial line: requests, streamed rows, settings.

Rows are returned as the device sends them; `acquisition` converts them to forces. Begin with
`amplifier.py`.
"""
