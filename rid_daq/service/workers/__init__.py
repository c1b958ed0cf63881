"""The jobs that run: a worker process for each, forked from a template, and its events."""
