"""Modbus/TCP Security: TLS 1.2 or newer, certificates on both sides."""

from __future__ import annotations

import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from identification.common.findings import error


@dataclass(frozen=True)
class TlsFiles:
    """PEM files: the authority both sides trust, this side's certificate and its key."""

    ca: Path
    certificate: Path
    key: Path

    def context(self, side: Literal["client", "server"]) -> ssl.SSLContext:
        """A context that refuses whoever has no certificate of that authority; a client also checks the host name.

        Raises CompstiffError (CS5105) where a file is not what it must be.
        """
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT if side == "client" else ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.verify_mode = ssl.CERT_REQUIRED
        try:
            context.load_verify_locations(self.ca)
        except (OSError, ssl.SSLError) as reason:
            raise error("CS5105", f"is not a certificate authority in PEM: {reason}", file=str(self.ca)) from reason
        try:
            context.load_cert_chain(self.certificate, self.key)
        except (OSError, ssl.SSLError) as reason:
            raise error("CS5105", f"is not a certificate in PEM that belongs to {self.key}: {reason}",
                        file=str(self.certificate)) from reason
        return context
