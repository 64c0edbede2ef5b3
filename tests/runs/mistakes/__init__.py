"""Mistakes planted in the table or the cell file, and what the command line says of them."""
