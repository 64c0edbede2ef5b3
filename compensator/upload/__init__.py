"""RAPID modules into a robot controller over Robot Web Services: `compstiff upload` (docs/rws.md)."""
