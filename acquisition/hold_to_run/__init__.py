"""Motion while a key is held: the dead-man, the set-points that obey it, and who holds the key.

The cyclic task asks the dead-man in every cycle; a keyboard or a button only feeds it. Begin with
`dead_man.py`, then `held_motion.py`.
"""
