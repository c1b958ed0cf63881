"""Operations on paths: timing, feedforward, velocity loops and path errors."""
