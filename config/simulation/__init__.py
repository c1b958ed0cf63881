"""Plant files and fault scripts of simulated cells.

A real cell does not read them. Begin with `plant.py`.
"""
