"""Import of text tables from other programs, with an import map and checks.

The program's own run folders are not read here. Begin with `import_map.py`, then `read.py`.
- `header.py` replaces the names of columns by their numbers, and `tables.py` converts the text of a
  table to numbers.
- `time_column.py` reads time stamps; `merged_topics.py` interpolates between rows of several
  topics.
- `velocities.py` leaves out velocity columns that the source did not fill; `columns.py` then
  converts the numbers to SI units.
- `soundness.py` drops impossible rows, and `findings.py` reports oddities of the other rows.
"""
