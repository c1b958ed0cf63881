"""Import maps that the program proposes for an unknown recording, with its reasons.

`source_table.py` finds the columns of a file, `column_groups.py` the joints' columns among them,
`known_sources.py` lists programs whose columns are known, and `propose.py` tries the maps that are
possible. `joint_states.py` does the same for bags with joint states.
"""
