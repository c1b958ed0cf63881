"""Signals and their spectra: bins of periodic signals, resampling, clocks against clocks.

Arrays only: no robot, no file, no device. Begin with `bins.py`.
"""
