"""Blocks: parts of a result for display, declared once for all renderers."""
