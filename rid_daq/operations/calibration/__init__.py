"""Operations that calibrate the arm: its geometry by a tracker, and its elastic gears."""
