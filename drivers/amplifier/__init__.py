"""The force plate's charge amplifier on its serial line: dialogue, stream, settings.

Rows as the device sends them; forces are made of them in `acquisition`. Begin with `amplifier.py`.
"""
