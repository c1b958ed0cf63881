"""Demo: the complete workflow on the bundled cell, compared with the simulation's true values.

It uses the jobs; only its command uses this package. Begin with `demo.py`.
"""
