"""Signals and their spectra: bins of periodic signals, resampling, clock comparison.

The code here works on arrays only, without robot, file or device. Begin with `bins.py`.
"""
