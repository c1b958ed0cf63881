"""What commands do with files, without their options: identify, design, recover.

No options and no command line, and nothing moves. Begin with `identification_job.py`.
"""
