"""Operations on the settings of drives."""
