"""The commands, one file each."""

import click


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="cornertouchd")
def main() -> None:
    """Multi-touch from four infrared corner cameras, spoken as TUIO 1.1."""
