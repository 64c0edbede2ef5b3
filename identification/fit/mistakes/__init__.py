"""Mistakes that people make in a table of load tests or in its cell file, and what tells them."""
