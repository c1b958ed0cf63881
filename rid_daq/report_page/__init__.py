"""The report: a result as one HTML file that is read, zoomed and printed.

Templates say what stands on it, `drawings` what is printed, `rid_daq/figures` what is zoomed. It
computes nothing that the result does not hold. Begin with `render.py`.
"""
