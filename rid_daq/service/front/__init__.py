"""Front process of the service: it accepts connections, answers STOP, and forwards the rest."""
