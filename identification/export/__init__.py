"""Export of models for other programs: robot descriptions, tables, functions.

Models that are not physically consistent are refused if the format needs them. Start with
`description.py`.
"""
