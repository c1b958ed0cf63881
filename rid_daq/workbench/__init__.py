"""Workbench: the pages of the service for a browser at the cell.

The server renders the pages (`templates`). Small JavaScript modules (`static`) update them, and
send the user's requests to the API. Begin with
`visit.py`, which renders the frame of every page; `pages.py` lists the pages.
"""
