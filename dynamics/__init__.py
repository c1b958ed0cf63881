"""The robot model: kinematics, and torques of rigid bodies, rotors, friction and spring."""
