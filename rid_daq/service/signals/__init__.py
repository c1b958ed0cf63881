"""Live signals of the cells: rows of motions as minima and maxima, and their transfer to viewers.

Begin with `signal_history.py`.
"""
