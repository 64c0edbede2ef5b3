"""What to believe after a part was measured."""
