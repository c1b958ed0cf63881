"""The simulated charge amplifier and its serial line, byte by byte.

Begin with `amplifier.py`.
"""
