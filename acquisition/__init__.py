"""Planned motions, the cyclic task, journals, run folders, imports, and processed recordings."""
