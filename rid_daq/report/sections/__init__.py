"""The sections of a result: one frozen class each, made by its method `of` from computed values.

A class declares the keys of its part of `result.json`. The package `section_blocks` turns a section
into blocks for terminal and page. This package reads and writes no files. Begin with `section.py`
and `average.py`.
"""
