"""Misfit -> cause -> extension -> gain (EFFECTS.md)."""
