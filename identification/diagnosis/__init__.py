"""Misfit -> cause -> extension -> gain (docs/effects.md)."""
