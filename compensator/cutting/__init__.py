"""What a cut is: stock, cutter, how they engage along a path, and the mean force of that."""
