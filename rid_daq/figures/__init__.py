"""Interactive figures: declared plots as Bokeh layouts, their JSON and their CSV.

A figure is made from a `Plot` and contains a Bokeh layout; this package computes only the
appearance. Pages, routes and files are in other packages. Begin with `embedding.py`, which
describes how a layout reaches a browser, then read `plot_figure.py` and `panel.py`.
"""
