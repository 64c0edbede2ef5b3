"""A force log becomes one wrench a target."""
