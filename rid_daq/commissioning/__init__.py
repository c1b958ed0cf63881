"""First motions of a cell, while a key is held: axis test, jog, home.

This package defines which motion a held key causes. `acquisition/hold_to_run` defines how the
cyclic task reacts to the key. Begin with `held_run.py`.
"""
