"""Experiment design: motions that determine the parameters best, within every limit.

Designs can use earlier estimates, so this folder depends on `estimation`. Motions are computed here
and planned in `acquisition`. Start with `task.py`, then `problem.py`, then `search.py`.
"""
