"""The process in front of the service: it accepts connections, answers STOP, hands on the rest."""
