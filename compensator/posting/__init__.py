"""Toolpaths of other forms become RAPID; a large program becomes parts."""
