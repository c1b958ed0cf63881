"""How accurate a payload session would be, by simulating many.

Answers before anything is driven. Begin with `monte_carlo.py`.
"""
