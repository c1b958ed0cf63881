"""Interfaces of devices, independent of the bus: axes, force plate, drive monitor.

Each file defines one protocol and its data; no bus and no device is named here. A new device is a
class that implements one of these protocols. Begin with `servo_axes.py`.
"""
