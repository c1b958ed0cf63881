"""Clocks, and the only modules that open a CAN bus or a serial line.

They transfer frames and bytes with deadlines; device protocols are elsewhere. Begin with
`can_link.py`.
"""
