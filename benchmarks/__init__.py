"""Benchmarks: `python -m benchmarks.NAME` measures the program and prints the figures.

A module that cannot be run in this way is part of one or more benchmarks. The peer of a benchmark
is another program that does the same work; it is measured for comparison, by `NAME_peer` in the
peer's own Python. A bar (in names, and as a key of the output) is a requirement on a figure.
"""
