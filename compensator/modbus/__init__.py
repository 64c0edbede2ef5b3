"""Offsets to the cell over Modbus: `compstiff push` and the embedded cell, `compstiff cell` (docs/modbus.md)."""
