"""Accuracy of estimates: identifiable directions, accuracy goals, benefit of a force plate.

This folder assesses estimates and makes no new ones. Start with `identifiability.py`.
"""
