"""What Windows does not have, taken away from the program under test: `pytest --no-posix`, here and in all it starts."""
