"""Kinds of motion, one file each: keys of the motion file, rows, description, next command.

No kind depends on the name of another kind. Begin with `motion.py`, then `fourier.py`;
`../motion_file.py` lists the kinds.
"""
