"""Blocks: the parts of a result that people see, declared once for every renderer."""
