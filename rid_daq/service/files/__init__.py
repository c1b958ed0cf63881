"""Editing of cell, robot and motion files by several clients: kinds, checks, versions, editors.

Start reading at `edited_file.py`. The routes are in `api/files.py`; the page is in the workbench.
"""
