"""Models for other programs: robot descriptions, tables, functions.

Writing, with a refusal of what cannot exist. Begin with `description.py`.
"""
