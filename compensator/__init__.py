"""compstiff: from a planned toolpath and logged forces to a corrected toolpath."""
