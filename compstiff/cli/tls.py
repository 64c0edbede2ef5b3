"""The options of Modbus/TCP Security, which `push` and `cell` share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from compstiff.cli.console import READABLE

if TYPE_CHECKING:
    from compensator.modbus.tls import TlsFiles

OPTIONS = {"--tls-ca": "PEM file: the authority both sides trust. All three: TLS, certificates on both sides.",
           "--tls-cert": "PEM file: this side's certificate.", "--tls-key": "PEM file: the key of that certificate."}


def with_tls(body: Callable[..., Any]) -> Callable[..., Any]:
    """The three options, handed over as `tls`: TlsFiles or None."""

    @functools.wraps(body)
    def run(*positional: Any, tls_ca: Path | None, tls_cert: Path | None, tls_key: Path | None, **arguments: Any) -> Any:
        return body(*positional, tls=_files(tls_ca, tls_cert, tls_key), **arguments)

    decorated: Callable[..., Any] = run
    for name, text in reversed(OPTIONS.items()):
        decorated = click.option(name, type=READABLE, help=text)(decorated)
    return decorated


def _files(ca: Path | None, certificate: Path | None, key: Path | None) -> TlsFiles | None:
    if not (ca or certificate or key):
        return None
    if not (ca and certificate and key):
        raise click.UsageError("--tls-ca, --tls-cert and --tls-key belong together")
    from compensator.modbus.tls import TlsFiles

    return TlsFiles(ca, certificate, key)
