"""Requests: typed input of operations, and the fields that several operations share.

Requests compute nothing and import no numerical libraries. Begin with `request.py`.
"""
