"""Processes, serial ports, folders, and faults of programs, for the simulated hardware.

This package contains no device. Begin with `device_process.py`.
"""
