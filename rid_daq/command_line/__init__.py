"""Command line of the program; the commands are built from the requests of operations."""
