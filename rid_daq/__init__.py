"""The program: one file per command, the session and the report."""
