"""What `rid-daq payload` does with files: identify from runs, write load data, read them back.

No options and no command line; sessions stand in `rid_daq/recording`. Begin with `payload_job.py`.
"""
