"""Operations on the service of this computer."""
