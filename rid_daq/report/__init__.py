"""A run's result: every number of it, its file, and the certificate of a payload.

Nothing here draws or writes a page; that is `report_page`. Begin with `result.py`.
"""
