"""A session: the cell that is opened, its lock, and the sessions that run on this machine.

Who may command a bus, and who is known to. Begin with `session.py`; decision 0031 says why.
"""
