"""Files of positions that an external instrument measured, such as a laser tracker.

`tracker_file.py` reads a point over time, `link_file.py` the positions of links, `pose_file.py`
poses with the point that was measured in each pose. All use `named_columns.py`, which reads a table
of numbers with a header. Imports of recordings with an import map belong to `acquisition/imports`.
Start reading at `tracker_file.py`.
"""
