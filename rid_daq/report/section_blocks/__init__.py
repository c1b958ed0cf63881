"""Blocks of the sections of a result: headings, texts, tables and plots for page and terminal."""
