"""Multi-touch from four infrared corner cameras, spoken as TUIO 1.1."""

from importlib.metadata import version

__version__ = version("cornertouchd")
