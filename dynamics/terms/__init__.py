"""Terms of a model: rigid bodies, rotors, friction, springs, payloads, armatures.

Each term has its own file, and terms do not know each other. Begin with `term.py`.
"""
