"""How well what is known is known: identifiable directions, goals, what a plate adds.

Judgement of estimates, no new ones. Begin with `identifiability.py`.
"""
