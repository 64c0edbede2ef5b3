"""Joint deflection logs: encoders on both sides of the gear, read in motion (docs/formats.md)."""
