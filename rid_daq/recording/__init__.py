"""What moves a cell and records it: motions, rehearsals, payload sessions, plate zero, streams.

Every recording goes through `RunSession`; what works on files alone stands in `jobs`. Begin with
`run_session.py`.
"""
