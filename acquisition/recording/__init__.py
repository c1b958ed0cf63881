"""`Recording`: measured data as arrays, from a run or an imported file.

The file format of a run's own journals is in `acquisition/journal`. Begin with `recording.py`.
"""
