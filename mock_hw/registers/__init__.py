"""The Modbus registers of simulated drives.

They contain parameters and temperatures; they move nothing. Begin with `registers.py`.
"""
