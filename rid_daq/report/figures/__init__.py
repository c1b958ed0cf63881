"""The report's figures: numbers of a section to one inline SVG each.

A figure takes fields of a section and returns markup; it computes nothing that the result does not
hold. Begin with `curves.py`, which has what all figures share.
"""
