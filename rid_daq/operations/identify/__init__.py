"""Operations on estimates of a robot."""
