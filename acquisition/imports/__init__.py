"""Somebody else's recording: tables and bags, read by a map, with a report of what is wrong in it.

Nothing of our own run folders. Begin with `import_map.py`, then `read.py`. Lines of text become
numbers in `tables.py`, messages of ROS become such a table in `bags.py`, `columns.py` makes SI of
it, `soundness.py` leaves out what cannot be true, `findings.py` says what is odd about the rest.
"""
