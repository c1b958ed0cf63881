"""Motion files and the tables beside them, as they are written; and maps of imports.

The schema only: rows of a motion are planned in `acquisition/motion`. Begin with `motion.py`.
"""
