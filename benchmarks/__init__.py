"""Benchmarks: `python -m benchmarks.NAME` measures the program and prints the figures.

The peer of a benchmark is another program that does the same work; it is measured for comparison.
The bar of a figure (in names, and as a key of the output) is the value that it must reach.
"""
