"""First motions of a cell, while a key is held: axis test, jog, home.

What a held key means; how the cyclic task obeys it stands in `acquisition/hold_to_run`. Begin with
`held_run.py`.
"""
