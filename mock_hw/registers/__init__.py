"""The simulated drives' Modbus registers.

Parameters and temperatures: nothing moves by them. Begin with `registers.py`.
"""
