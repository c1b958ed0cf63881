"""Operations on paths: timing, feedforward and path errors."""
