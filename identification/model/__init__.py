"""The model eta(k, u) that is identified, and that the compensator uses as it is."""
