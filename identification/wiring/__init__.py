"""Search for common mistakes of wiring, units and files that explain recordings better.

This folder contains the mistakes and their search; it makes no estimate. Start with `mistakes.py`,
then `search.py`.
"""
