"""Interactive figures of the workbench: typed results to bokeh layouts, their JSON and their CSV.

A figure takes a section of a result, or what was measured, and returns a layout; it computes
nothing but how it is drawn. Pages, routes and files live above. Begin with `embedding.py`, which
says how a layout reaches a browser, then `panel.py`, which has what all figures share.
"""
