"""The force plate's charge amplifier on its serial line: dialogue, stream, settings.

Rows are returned as the device sends them; `acquisition` converts them to forces. Begin with
`amplifier.py`.
"""
