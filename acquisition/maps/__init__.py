"""Import maps: descriptions of other programs' recordings, with their checks.

No recording is read here; `acquisition/imports` does that. Begin with `import_map.py`.
- `import_joint.py` has the columns of a joint, and `import_plate.py` those of a force plate.
- `import_units.py` has the units of the columns.
- `time_column.py` describes time stamps, and converts their text to seconds.
"""
