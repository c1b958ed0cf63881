"""What commands do, without their options: record, identify, weigh, design, recover.

No options and no command line. Begin with `run_session.py`.
"""
