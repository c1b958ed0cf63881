"""Runs as operations read them: the recording (`RunData.load`) and its motion (`MotionRun`).

Operations read recordings through this package, which compares a run's files with its manifest.
Begin with `run_data.py`.
"""
