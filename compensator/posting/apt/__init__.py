"""Reads APT cutter location files (.apt, .cls, .cl) as CAM systems write them."""

from compensator.posting.apt.reader import read_apt

__all__ = ["read_apt"]
