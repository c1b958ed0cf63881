"""Signals and their spectra: bins of periodic signals, resampling, clock comparison.

Arrays only: no robot, no file, no device. Begin with `bins.py`.
"""
