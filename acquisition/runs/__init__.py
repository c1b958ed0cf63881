"""Run folders: the only truth about a run, with a manifest that every reader compares.

Files by name and hash; what is in them is read elsewhere. Begin with `folder.py`.
"""
