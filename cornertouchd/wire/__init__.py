"""Bytes <-> values, no I/O."""
