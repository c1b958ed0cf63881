"""Requests: the typed input of operations, and the parts that several of them share.

Nothing here computes, and nothing imports numerics. Begin with `request.py`.
"""
