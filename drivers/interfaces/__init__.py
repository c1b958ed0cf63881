"""Interfaces of devices, independent of the bus: axes, force plate, drive monitor.

Each file defines one interface (`typing.Protocol`) and its data, independent of any bus and maker.
To support a new device, write a class with such an interface. Begin with `servo_axes.py`.
"""
