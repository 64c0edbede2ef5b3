"""The tests; with `--no-posix` POSIX is taken away here, before anything of the program is imported."""

from tests.without_posix.removal import apply

apply()
