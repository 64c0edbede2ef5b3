"""Entry point of `compstiff` and of `python -m compensator`: so small that Ctrl-C is answered from the first import on."""

import os


def run() -> None:
    """Runs the command line. Ctrl-C while its modules are still being imported exits 130 as well."""
    try:
        from compensator.cli import main

        main()
    except KeyboardInterrupt:
        os._exit(130)


if __name__ == "__main__":
    run()
