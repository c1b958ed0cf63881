"""What the `payload` commands do: the guided session, and what is made of its result.

Other commands' stand in the room above. Begin with `session.py`.
"""
