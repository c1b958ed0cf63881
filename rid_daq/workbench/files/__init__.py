"""Pages on which cell, robot and motion files are shown and edited.

The pages also make motions from poses that a person chooses in the 3-D view. The checks, versions
and other editors of a file are in `service/files`.
Start reading at `file_pages.py`.
"""
