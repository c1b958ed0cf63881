"""Operations on the service of this computer: start it, make a token."""
