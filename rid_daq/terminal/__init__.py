"""Output and input of a terminal: lines, tables, verdicts, exit codes, questions, held keys.

This package contains texts and layout; it executes no operations. Begin with `console.py`.
"""
