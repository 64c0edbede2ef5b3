"""Where a controller's web services listen, who logs in, and whose certificate is believed."""

from __future__ import annotations

import hashlib
import hmac
import ssl
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from identification.common.findings import error
from identification.model.cell import Cell
from identification.model.cell_file import host_alone


@dataclass(frozen=True)
class Controller:
    """tls: HTTPS; its certificate is that of `fingerprint` (SHA-256, hexadecimal), else one of an authority in the PEM file
    `ca`, else of one this computer trusts, for this host. timeout_s bounds every wait, retries how often a request that may be
    repeated is repeated. The password is in no text of this value.

    >>> compstiff.Controller("192.168.125.1", "Default User", "secret")
    Controller(host='192.168.125.1', user='Default User', tls=True, ...)
    """

    host: str
    user: str
    password: str = field(repr=False)
    tls: bool = True
    port: int | None = None
    ca: Path | None = None
    fingerprint: str | None = None
    timeout_s: float = 10.0
    retries: int = 3

    @classmethod
    def of(cls, cell: Cell, password: str, **changed: Any) -> Controller:
        """Of the section `controller` of cell.yaml. changed: fields given otherwise; None is as if it were not given.

        Raises CompstiffError (CS6104) where no host is stated.
        """
        stated = cell.controller
        ca = None if stated.ca is None else cell.source.parent / stated.ca
        own = cls(stated.host or "", stated.user, password, stated.tls, stated.port, ca, stated.fingerprint)
        controller = replace(own, **{name: value for name, value in changed.items() if value is not None})
        if not controller.host:
            raise error("CS6104", "states no controller.host", file=str(cell.source),
                        hint="write controller: {host: 192.168.125.1} into it, or give --host")
        try:
            host_alone(controller.host)
        except ValueError as reason:
            raise error("CS6104", f"the host '{controller.host}' {reason}") from reason
        return controller

    @property
    def url(self) -> str:
        """Scheme, host and port."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'https' if self.tls else 'http'}://{host}:{self.at_port}"

    @property
    def at_port(self) -> int:
        """The port stated, else that of the scheme."""
        return self.port or (443 if self.tls else 80)

    def context(self) -> ssl.SSLContext:
        """TLS 1.2 or newer, the certificate checked before a byte is sent. Raises CompstiffError (CS6107): the file `ca`."""
        if self.fingerprint:
            return _pinned(self.fingerprint)
        try:
            context = ssl.create_default_context(cafile=None if self.ca is None else str(self.ca))
        except (OSError, ssl.SSLError) as reason:
            raise error("CS6107", f"is not a certificate authority in PEM: {reason}", file=str(self.ca)) from reason
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        return context

    def shown_fingerprint(self) -> str | None:
        """SHA-256 of the certificate that whoever answers there shows, not believed; None where none can be had."""
        try:
            shown = ssl.get_server_certificate((self.host, self.at_port), timeout=self.timeout_s)
        except (OSError, ValueError):
            return None
        return hashlib.sha256(ssl.PEM_cert_to_DER_cert(shown)).hexdigest()


def _pinned(fingerprint: str) -> ssl.SSLContext:
    """A context that believes one certificate alone, whoever signed it, for whatever host and time."""

    class Pinned(ssl.SSLSocket):
        def do_handshake(self, block: bool = False) -> None:
            super().do_handshake(block)
            shown = hashlib.sha256(self.getpeercert(binary_form=True) or b"").hexdigest()
            if not hmac.compare_digest(shown, fingerprint):
                raise ssl.SSLCertVerificationError(1, f"the certificate's SHA-256 is {shown}, not the one that is pinned")

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    context.sslsocket_class = Pinned
    return context
