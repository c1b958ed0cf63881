"""Base parameters, experiment design, estimators and validation."""
