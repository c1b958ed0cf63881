"""Compiled loops over samples: recursion, gradients, threads, eight samples at once.

No models and no files: arrays in, arrays out. Begin with `rigid_body.py`; decision 0008 says why.
"""
