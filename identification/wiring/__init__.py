"""Which common mistake of wiring, units or files explains recordings better than what was stated.

Mistakes and their search; no estimate is made here. Begin with `mistakes.py`, then `search.py`.
"""
