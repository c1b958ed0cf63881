"""What `rid-daq drives` does with what drives hold: keep it, put it back.

No options and no command line, and nothing moves. Begin with `drives_job.py`.
"""
