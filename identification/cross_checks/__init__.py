"""Three other methods on the same data, to be told whether they agree.

Each solves the same equations in its own way. Begin with `agreement.py`.
"""
