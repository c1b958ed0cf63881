"""Sessions: opening a cell, its lock, and the list of sessions that run on this computer.

A session is one program that controls a cell. Begin with `session.py`; decision 0031 gives the
reasons.
"""
