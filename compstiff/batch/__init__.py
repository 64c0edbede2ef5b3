"""Many programs: pairing with their logs, processes, a watched folder."""
