"""State of the service that survives a restart: one SQLite file, one class per subject.

Only this package contains SQL. Begin with `database.py`.
"""
