"""Interactive figures: declared plots to bokeh layouts, their JSON and their CSV.

A figure takes a `Plot` and returns a layout; it computes nothing but how it is drawn. Pages, routes
and files live above. Begin with `embedding.py`, which says how a layout reaches a browser, then
`plot_figure.py` and `panel.py`.
"""
