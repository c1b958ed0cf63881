"""Results of runs: all their numbers, the result file, and a payload's certificate.

This package neither draws nor writes pages; the package `report_page` does. Begin with `result.py`.
"""
