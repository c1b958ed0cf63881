"""Terms of a model: rigid bodies, rotors, friction, springs, payloads, armatures.

Each term is a separate module, independent of the other terms. Begin with `term.py`.
"""
