"""Kinds of motion. Each file defines the keys of a motion file and computes the rows.

No kind depends on the name of another kind. Begin with `motion.py`, then `fourier.py`;
`../motion_file.py` lists the kinds.
"""
