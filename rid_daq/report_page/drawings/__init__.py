"""Drawings of a report for print: one inline SVG per plot.

A drawing takes a declared plot and returns markup; it computes no results. Begin with `plot.py`.
"""
