"""Interactive figures: a declared plot as JSON for the browser, and its table as CSV.

This package computes only the appearance. Pages, routes and files are in other packages. Begin with
`figure_item.py`, which describes what the browser receives, and `figure.js`, which draws it.
"""
