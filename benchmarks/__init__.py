"""Benchmarks: `python -m benchmarks.NAME` prints ratios against a peer or limit."""
