"""Pages on which cell, robot and motion files are shown and edited.

The checks, versions and other editors of a file are in `service/files`; this package only shows
them.
Start reading at `file_pages.py`.
"""
