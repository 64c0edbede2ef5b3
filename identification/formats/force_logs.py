"""One door to the force logs that sensors and public data sets write in forms of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from identification.formats.force_samples import ForceSamples


def read_force_samples(
    file: Path, form: str, *, rate_hz: float | None = None, channels: Sequence[str] | None = None,
    counts_per_n: float | None = None, counts_per_nm: float | None = None,
) -> ForceSamples:
    """Reads a force log in its form (`metallicadour`, `lvm`, `net-ft`); None: what is usual of the form.

    rate_hz: samples a second (metallicadour, net-ft); channels: names of the force, then the moment channels (lvm);
    counts_per_n, counts_per_nm: of the sensor (net-ft). Raises what the form's reader raises.
    """
    if form == "lvm":
        from identification.formats import lvm

        return lvm.read_lvm(file, channels or lvm.CHANNELS)
    if form == "net-ft":
        from identification.formats import net_ft

        return net_ft.read_net_ft(file, counts_per_n=counts_per_n or net_ft.COUNTS,
                                  counts_per_nm=counts_per_nm or net_ft.COUNTS, rate_hz=rate_hz or net_ft.RATE_HZ)
    from identification.formats import metallicadour

    return metallicadour.read_metallicadour(file, rate_hz=rate_hz or metallicadour.RATE_HZ)
