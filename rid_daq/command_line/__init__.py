"""Command line of the program; the commands are built from the operations' request classes."""
