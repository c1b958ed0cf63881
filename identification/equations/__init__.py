"""Equations of measured rows: on DFT bins or in the time domain, with or without a plate.

This folder contains equations only; `identification/estimation` solves them. Start with `bins.py`.
"""
