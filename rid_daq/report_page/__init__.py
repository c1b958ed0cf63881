"""The report: a result as one self-contained HTML file, for reading, zooming and printing.

The sections of a result provide blocks, and the template `blocks.html` lays them out. The package
`drawings` draws plots for print; `rid_daq/figures` makes the figures for zooming. This package
computes no results. Begin with `render.py`.
"""
