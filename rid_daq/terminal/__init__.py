"""What a person at a terminal sees: lines, tables, verdicts, exit codes, questions.

Words and layout; no job is done here. Begin with `console.py`.
"""
