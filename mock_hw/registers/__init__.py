"""The Modbus registers of simulated drives.

They contain parameters and temperatures, and cannot move a drive. Begin with `registers.py`.
"""
