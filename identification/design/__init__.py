"""Experiment design: which motion tells the parameters best, within every limit.

Earlier estimates count, so that it stands above them. Motions are computed here and planned in
`acquisition`. Begin with `task.py`, then `problem.py`, then `search.py`.
"""
