"""`Recording`: what was measured, as arrays, wherever it came from.

No file format of the run's own journals (`acquisition/journal`). Begin with `recording.py`.
"""
