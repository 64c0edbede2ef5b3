"""The front door: the chain for people (`compstiff`) and for programs (`import compstiff`)."""
