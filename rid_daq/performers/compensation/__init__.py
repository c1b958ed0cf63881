"""What commands do that make a path closer or faster: loops, feedforward, refinement, time.

Models of the robot are identified in the room above. Begin with `compensate.py`.
"""
