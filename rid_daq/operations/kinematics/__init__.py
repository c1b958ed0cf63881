"""Operations of a kinematic calibration: calibrate a robot, propose poses to measure."""
