"""Periodic signals, the cyclic task, recording, and the processing of recordings."""
