"""Clocks, CAN buses and serial ports.

Only these modules open a bus or a port. They transfer frames and bytes with deadlines and contain
no device protocol. Begin with `can_link.py`.
"""
