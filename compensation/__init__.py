"""Frequency responses, velocity loops, feedforward and retiming: reduction of the path error."""
