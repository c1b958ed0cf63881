"""The drives' parameters and temperatures over Modbus, beside the cyclic exchange.

Reading only: nothing here starts or stops a motion. Begin with `drive_monitor.py`.
"""
