"""The robot model: kinematics, rigid bodies, rotors, friction, spring, and their sum."""
