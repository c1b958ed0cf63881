"""The simulated force plate: charge amplifier and serial line, exact to the byte.

Begin with `amplifier.py`.
"""
