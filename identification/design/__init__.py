"""Optimal experiments: which poses and loads to measure, and how far that is from the best that could be measured."""
