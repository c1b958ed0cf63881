"""Compiled loops over samples: recursion, gradients, threads, eight samples at once.

Kernels know arrays only, no models and no files. Begin with `rigid_body.py`; decision 0008 explains
why they exist.
"""
