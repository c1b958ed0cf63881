"""Experiment design: which motion tells the parameters best, within every limit.

Motions are computed here and planned in `acquisition`. Begin with `problem.py`, then `search.py`.
"""
