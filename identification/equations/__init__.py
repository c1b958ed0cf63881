"""Measured rows to equations: on bins or in time, whitened, with or without a plate.

Equations only; who solves them stands in `identification/estimation`. Begin with `bins.py`.
"""
