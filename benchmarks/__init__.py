"""Benchmarks: `python -m benchmarks.NAME` measures the program and prints the figures.

A module without `main` is part of one or more benchmarks. The peer of a benchmark is another
program that does the same work; it is measured for comparison. The bar of a figure (in names, and
as a key of the output) is the limit that it must keep, a minimum or a maximum.
"""
