"""`python -m compensator` is `compstiff`."""

from compensator.cli import main

main()
