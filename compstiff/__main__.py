"""Entry point of `compstiff` and of `python -m compstiff`: so small that Ctrl-C is answered from the first import on."""

import gc
import os
import sys

INTERRUPTED = 130


def run() -> None:
    """Runs the command line and ends this process; Ctrl-C exits 130 while modules are imported, too."""
    # Matrices of six by six: further threads of the linear algebra wait for work and take CPU time for it.
    if "OMP_NUM_THREADS" not in os.environ:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Arrow's own allocator keeps what it was given back.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    # Modules are many objects and no garbage: to look for it among them as often as usual is a tenth of a start.
    gc.set_threshold(50_000)
    try:
        from compstiff.cli.main import main

        main()
    except KeyboardInterrupt:
        files = sys.modules.get("identification.common.files")
        os._exit(0 if files and files.written else INTERRUPTED)
    except SystemExit as done:
        import signal

        # What was to be done is done: a Ctrl-C from here on changes nothing.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if done.code == INTERRUPTED:
            # CPython dies by the signal at its end, with another exit code, if the interrupt once met code run by `exec`.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(INTERRUPTED)
        raise


if __name__ == "__main__":
    run()
