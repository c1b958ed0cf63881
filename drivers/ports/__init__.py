"""Clocks, and the only places that open a CAN bus or a serial line.

Frames and bytes with deadlines; no protocol of a device. Begin with `can_link.py`.
"""
