"""The processes of one recording: task, recorders, monitor, plate, and how they end.

Starting, watching and ending them; what a cycle does stands in `acquisition/task`. Begin with
`record.py`.
"""
