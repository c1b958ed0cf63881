"""Load data in the formats of robot controllers, written and read.

This folder contains only formats and frames of robot makers. Start with `formats.py`.
"""
