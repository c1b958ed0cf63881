"""The report: a result as one HTML file that is read, zoomed and printed.

Sections give blocks, which `blocks.html` lays out; `drawings` draws plots for paper,
`rid_daq/figures` for zooming. Nothing is computed here. Begin with `render.py`.
"""
