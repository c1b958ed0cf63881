"""The web server: bounded, guarded against unknown pages, and what it shows viewers."""
