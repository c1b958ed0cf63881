"""The drives' parameters and temperatures over Modbus, in parallel to the cyclic exchange.

Registers are only read; this package cannot start or stop a motion. Begin with `drive_monitor.py`.
"""
