"""Takes POSIX away from the three packages: modules, functions and signals, and renames over files that are open.

Only imports in the packages themselves meet it: libraries keep what they have, for on Windows they have their own. Gone for
everybody are os.fork and the signal handlers of asyncio's loop. A rename over a file that this process has open fails, as on
Windows; whether another process has it open is not looked at.
"""

from __future__ import annotations

import asyncio
import builtins
import os
import signal
import sys
import types

ASKED = "COMPSTIFF_NO_POSIX"
PACKAGES = ("compstiff", "compensator", "identification")
MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "spwd", "syslog", "termios", "tty"}
# What the documentation of `os` and `signal` marks as not available on Windows, as far as a program might use it.
OS = {
    "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_SYNC", "chown", "chroot", "ctermid", "fchdir", "fchmod",
    "fchown", "fork", "forkpty", "getegid", "geteuid", "getgid", "getgroups", "getloadavg", "getpgid", "getpgrp",
    "getpriority", "getuid", "killpg", "lchown", "lockf", "mkfifo", "mknod", "nice", "openpty", "pipe2", "posix_fallocate",
    "posix_spawn", "pread", "pwrite", "sched_getaffinity", "sched_setaffinity", "sendfile", "setegid", "seteuid", "setgid",
    "setpgid", "setsid", "setuid", "statvfs", "sync", "sysconf", "uname", "wait", "wait3", "wait4", "WNOHANG"}
SIGNALS = {
    "SIGALRM", "SIGBUS", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGIO", "SIGKILL", "SIGPIPE", "SIGPOLL", "SIGQUIT", "SIGSTOP",
    "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGUSR1", "SIGUSR2", "SIGWINCH", "alarm", "pause", "pthread_kill", "pthread_sigmask",
    "setitimer", "siginterrupt", "sigpending", "sigtimedwait", "sigwait", "sigwaitinfo"}


def is_open(path: str | os.PathLike[str]) -> bool:
    """Whether this process has the file open."""
    there = os.path.realpath(path)
    for number in os.listdir("/proc/self/fd"):
        try:
            if os.readlink(f"/proc/self/fd/{number}") == there:
                return True
        except OSError:
            continue
    return False


def renames(name: str):
    """`os.replace` or `os.rename` that refuses what is open, and rename also what exists."""
    def renamed(source, target, **named):
        if is_open(source) or is_open(target):
            raise PermissionError(13, "The process cannot access the file because it is being used by another process",
                                  os.fspath(target))
        if name == "rename" and os.path.exists(target) and not os.path.samefile(source, target):
            raise FileExistsError(17, "Cannot create a file when that file already exists", os.fspath(target))
        return getattr(os, name)(source, target, **named)

    return renamed


class View(types.ModuleType):
    """A module as the packages see it: what a test changes in the module itself they see, too."""

    def __init__(self, module: types.ModuleType, without: set[str], **instead: object) -> None:
        super().__init__(module.__name__)
        vars(self).update(instead, _module=module, _without=without)

    def __getattr__(self, name: str) -> object:
        if name in self._without:
            raise AttributeError(f"module '{self.__name__}' has no attribute '{name}' (--no-posix)")
        return getattr(self._module, name)


def take_away() -> None:
    """From here on, for this process; once."""
    if getattr(builtins, "_without_posix", False):
        return
    assert not any(name.partition(".")[0] in PACKAGES for name in sys.modules), "the packages are there already"
    # On builtins, which is one in a process however often this module is imported.
    builtins._without_posix = True      # type: ignore[attr-defined]
    views = {"os": View(os, OS, name="nt", replace=renames("replace"), rename=renames("rename")),
             "signal": View(signal, SIGNALS)}
    plain = builtins.__import__

    def imported(name, globals=None, locals=None, fromlist=(), level=0):
        found = plain(name, globals, locals, fromlist, level)
        if ((globals or {}).get("__name__") or "").partition(".")[0] in PACKAGES:
            if name.partition(".")[0] in MODULES:
                raise ModuleNotFoundError(f"No module named '{name}' (--no-posix)", name=name)
            return views.get(name, found)
        return found

    builtins.__import__ = imported
    for name in ("fork", "forkpty"):
        if hasattr(os, name):
            delattr(os, name)

    # What asyncio's loop does on Windows; replacing a method of a class is what mypy objects to.
    def no_handlers(*_: object) -> None:
        raise NotImplementedError

    asyncio.SelectorEventLoop.add_signal_handler = no_handlers      # type: ignore[method-assign]


def asked() -> bool:
    """Whether it was asked for on the command line of this pytest, or by the one that started this process."""
    return "--no-posix" in sys.argv or ASKED in os.environ


def apply() -> None:
    """Takes POSIX away if that was asked for, here and in every Python process that is started from here."""
    if not asked():
        return
    os.environ[ASKED] = "1"
    here = os.path.dirname(os.path.abspath(__file__))
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    start = os.path.join(here, "start")
    if start not in paths:
        os.environ["PYTHONPATH"] = os.pathsep.join([start, os.path.dirname(os.path.dirname(here)), *filter(None, paths)])
    take_away()
