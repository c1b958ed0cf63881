"""The worker: the process of one job of the service; what a command does, told as events.

It begins when the service says so, answers nobody but the service, and ends its job where the
service is gone. Begin with `worker.py`.
"""
