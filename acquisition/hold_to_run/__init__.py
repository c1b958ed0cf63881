"""Motion while a key is held: the dead-man, its set-points, and the judgement of key messages.

The cyclic task reads the dead-man in every cycle; a keyboard or a button only updates it. Begin
with `dead_man.py`, then `held_motion.py`.
"""
