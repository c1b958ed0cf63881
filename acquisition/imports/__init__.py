"""Import of text tables from other programs, with an import map and checks.

The program's own run folders are not read here. `acquisition/maps` has the import maps. Begin with
`read.py`.
- `header.py` replaces the names of columns by their numbers, and `tables.py` reads the tables:
  `number_blocks.py` converts blocks of plain lines to numbers, and `row_reader.py` the other lines.
- `merged_topics.py` interpolates between rows of several topics.
- `plate_table.py` reads the rows of a force plate.
- `velocities.py` leaves out velocity columns that the source did not fill; `columns.py` then
  converts the numbers to SI units.
- `soundness.py` drops impossible rows, and `findings.py` reports oddities of the other rows.
"""
