"""First motions of a cell, while a key is held: axis test, jog, home.

This room defines the meaning of a held key; `acquisition/hold_to_run` defines the reaction of the
cyclic task. Begin with `held_run.py`.
"""
