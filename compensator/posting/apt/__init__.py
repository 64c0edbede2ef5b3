"""Reads APT cutter location files as CAM systems write them."""

from compensator.posting.apt.reader import read_apt

__all__ = ["read_apt"]
