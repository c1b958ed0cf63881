"""Plant files and fault scripts of simulated cells.

A real cell reads none of them. Begin with `plant.py`.
"""
