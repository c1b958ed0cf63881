"""Export of models for other programs: robot descriptions, tables, functions.

Robot descriptions need physically consistent links: other models are refused. Start with
`description.py`.
"""
