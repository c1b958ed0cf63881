"""Motion while a key is held: dead-man, set-points, and the check of messages about keys.

The cyclic task reads the dead-man in every cycle; a keyboard or a button only updates it. Begin
with `dead_man.py`, then `held_motion.py`.
"""
