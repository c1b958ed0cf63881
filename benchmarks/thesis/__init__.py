"""Comparison with Verdonck's thesis: `python -m benchmarks.thesis` writes `docs/thesis.md`.

The experiments of chapters 3 to 6 are repeated on simulated cells with the program's own commands.
`facts.yaml` has the numbers of the thesis, `docs/thesis.json` the results of the last full run.
"""
