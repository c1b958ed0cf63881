"""Running jobs: each has a worker process, which is forked from a template, and an event file."""
