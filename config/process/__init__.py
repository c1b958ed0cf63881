"""Interaction of rid-daq's processes with the operating system: signals, names, locks, shortages.

It contains nothing about robots or users' files. Begin with `termination.py`, which handles the
signals that stop a program.
"""
