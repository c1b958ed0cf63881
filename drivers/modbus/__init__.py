"""The drives' parameters and temperatures over Modbus, in parallel to the cyclic exchange.

Everything is read only: nothing here starts or stops a motion. Begin with `drive_monitor.py`.
"""
