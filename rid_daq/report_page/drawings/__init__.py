"""The report's drawings: numbers of a section to one inline SVG each, as it is printed.

A drawing takes fields of a section and returns markup; it computes nothing that the result does not
hold. Begin with `curves.py`, which has what all drawings share.
"""
