"""The simulated charge amplifier and its serial line.

What the device would send, bit by bit. Begin with `amplifier.py`.
"""
