"""Somebody else's recording: tables of columns, read by a map, with a report of what was dropped.

Nothing of our own run folders. Begin with `import_map.py`, then `read.py`.
"""
