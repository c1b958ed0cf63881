"""Benchmarks: `python -m benchmarks.NAME` measures the program and prints the figures.

The peer of a benchmark is another program that does the same work; it is measured for comparison.
The bar of a figure is the value that it must reach.
"""
