"""Compiled loops over samples: dynamics, gradients, filters, friction, eight samples at once.

Kernels work on arrays only, not on models or files. Begin with `rigid_body.py`; decision 0008
explains why compiled kernels are used.
"""
