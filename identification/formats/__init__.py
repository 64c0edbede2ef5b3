"""Readers for data that others have published, in the form they have it."""
