"""The feedforward of a motion that is known: computed, refined, judged, kept in a file.

Off line. Begin with `inverse.py`.
"""
