"""What a measured part taught: read from learned.json and carried to programs."""
