"""What a process of ours does with its operating system: signals, names, locks, shortages.

Nothing about robots or files of users. Begin with `termination.py`: which signals stop what.
"""
