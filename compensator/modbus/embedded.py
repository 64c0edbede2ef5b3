"""The embedded cell: an offset device for a cell.yaml, with its table kept in a state directory, served until it is stopped."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from compensator.modbus.device import OffsetDevice
from compensator.modbus.server import Endpoint, serve
from compensator.modbus.state import TableFiles, TableStore, locked
from compensator.modbus.wire import Header
from identification.common.findings import Finding
from identification.model.cell import Cell


@dataclass(frozen=True)
class Served:
    """What a device did until it was stopped. active: header of the table that was active then."""

    commits: int
    active: Header | None
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"active": self.active.as_dict() if self.active else None, "commits": self.commits}

    def lines(self) -> list[str]:
        """What the terminal shows."""
        return [f"stopped; commits: {self.commits}, active table: {_shown(self.active)}"]


def device_of(cell: Cell, state: Path | None = None) -> OffsetDevice:
    """The device with the cell's limit and robot; state: the directory that keeps its table. Raises CompstiffError (CS5102)."""
    limit_um = min(math.floor(1e6 * cell.max_offset + 1e-6), 0xFFFF)
    return OffsetDevice(TableFiles(state) if state else TableStore(), limit_um, cell.robot.name)


async def serve_cell(
    cell: Cell, endpoint: Endpoint, state: Path | None, stop: asyncio.Event, *,
    warn: Callable[[Finding], None] = lambda finding: None, ready: Callable[[str], None] = lambda text: None,
) -> Served:
    """Serves the register map until `stop` is set; its limit and robot are the cell's.

    state: the directory that keeps the active table, None: it is lost at the end. warn is called with each finding before it
    listens, ready with a line that says where it does. Raises CompstiffError: CS5101 another device holds the directory,
    CS5102 what is in it was changed, CS5103 it cannot listen, CS0004 the directory cannot be written.
    """
    findings = tuple(_findings(endpoint, state))
    with locked(state) if state else contextlib.nullcontext():
        device = device_of(cell, state)
        for finding in findings:
            warn(finding)
        await serve(device, endpoint, stop, lambda port: ready(_listening(replace(endpoint, port=port), device)))
    return Served(device.commits, device.active.header if device.active else None, findings)


def _loopback(host: str) -> bool:
    """Whether nobody but this computer reaches the host: 127.0.0.0/8, ::1 or localhost."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def _findings(endpoint: Endpoint, state: Path | None) -> list[Finding]:
    findings = []
    if not endpoint.tls and not _loopback(endpoint.host):
        findings.append(Finding("CS5104", "warning", f"listening on {endpoint.host}: Modbus has no login, whoever reaches this "
                                "port can change offsets", hint="a network of its own, or --tls-ca, --tls-cert and --tls-key"))
    if state is None:
        findings.append(Finding("CS5106", "note", "without --state the active table is lost when the cell stops"))
    return findings


def _listening(endpoint: Endpoint, device: OffsetDevice) -> str:
    return (f"listening on {endpoint.host}:{endpoint.port} unit {endpoint.unit}, limit {1e-3 * device.limit_um:g} mm, "
            f"active table: {_shown(device.active.header if device.active else None)}")


def _shown(header: Header | None) -> str:
    return f"{header.name}, {header.rows} rows" if header else "none"
