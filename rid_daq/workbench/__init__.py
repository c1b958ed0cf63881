"""The workbench: pages of the service for a browser at the cell.

The server renders them (`templates`); small JavaScript modules (`static`) show what changes, and
send what a person asks for to the API, which can do all of it. Begin with `visit.py`,
the shell of every page; `pages.py` lists the pages.
"""
