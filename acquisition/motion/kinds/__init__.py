"""The kinds of motion, a file each: what its file may say, its rows, its sentence, what comes next.

No kind asks for another one's name. Begin with `motion.py`, then `fourier.py`; `../motion_file.py`
lists the kinds.
"""
