"""Run folders, each with a manifest that lists its files.

The code here handles files by name and hash; other packages read their contents. Begin with
`folder.py`.
"""
