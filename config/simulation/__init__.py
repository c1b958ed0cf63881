"""What is simulated and what goes wrong there: plant files and fault scripts.

Nothing that a real cell reads. Begin with `plant.py`.
"""
