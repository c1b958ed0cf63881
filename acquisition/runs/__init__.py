"""Run folders, each with a manifest that lists its files.

This folder of code handles files by name and hash; the contents are read elsewhere. Begin with
`folder.py`.
"""
