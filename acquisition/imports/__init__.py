"""Import of tables and ROS bags from other programs, with an import map and checks.

The program's own run folders are not read here. Begin with `import_map.py`, then `read.py`.
`tables.py` converts text to numbers, `bags.py` converts ROS messages to such a table;
`time_column.py` reads time stamps, and `merged_topics.py` interpolates between rows of several
topics. `columns.py` converts the numbers to SI units; velocities that the source did not fill are
left out before (`velocities.py`). `soundness.py` drops impossible rows, `findings.py` reports
oddities of the other rows.
"""
