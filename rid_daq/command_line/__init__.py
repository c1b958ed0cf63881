"""The command line of operations, built from their requests."""
