"""What the program asks of devices, whatever the bus: axes, force plate, drive monitor.

One protocol a file, with the data that it hands over; no bus and no device is named here. A new
device is a class that does what one of these protocols says. Begin with `servo_axes.py`.
"""
