"""What a model is made of: rigid bodies, rotors, friction, springs, payloads, armatures.

One term a file, as `term.py` describes it; no term knows another. Begin with `term.py`.
"""
