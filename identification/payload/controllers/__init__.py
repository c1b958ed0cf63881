"""Load data as robot controllers write them, and back.

Formats and frames of makers alone. Begin with `formats.py`.
"""
