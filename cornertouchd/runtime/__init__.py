"""Threads: capture, fusing, supervision."""
