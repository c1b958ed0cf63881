"""A payload's certificate as PDF: what stands on it, its pages, its picture.

Begin with `certificate.py`.
"""
