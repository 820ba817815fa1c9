"""`cornertouchd check`: everything that can be wrong, each with its remedy."""

import json
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from cornertouchd.config import ConfigError, Settings, find_settings, read_settings
from cornertouchd.guiding.finding import Finding, well, wrong
from cornertouchd.runtime.assembly import make_ports
from cornertouchd.runtime.checks import check_installation
from cornertouchd.runtime.checks.installation import Installation, environment_of, unit_for
from cornertouchd.runtime.clock import MonotonicClock

MARKS = {"ok": "[green]ok[/]", "warning": "[yellow]warning[/]", "error": "[red bold]error[/]"}


@click.command()
@click.option(
    "--config",
    "config_file",
    type=click.Path(path_type=Path),
    help="Settings; else $CORNERTOUCHD_CONFIG, else /etc/cornertouchd/cornertouchd.toml.",
)
@click.option("--json", "as_json", is_flag=True, help="Findings as a JSON array on stdout.")
def check(config_file: Path | None, as_json: bool) -> None:
    """Look at everything that can be wrong, and say what to do.

    Exit status 1 if something does not work. Cameras that the service uses are not opened: stop it
    to have them looked at.
    """
    findings = list(find_all(config_file))
    if as_json:
        click.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        Console().print(_table(findings))
    sys.exit(any(finding.level == "error" for finding in findings))


def find_all(config_file: Path | None) -> Iterator[Finding]:
    """Yield everything that is to be said of an installation."""
    try:
        path = find_settings(config_file, os.environ)
        settings = read_settings(path) if path else Settings()
    except ConfigError as error:
        for line in str(error).splitlines():
            yield wrong("configuration", line, "correct the file; every setting is explained in it")
        return
    yield well("configuration", str(path) if path else "none: every setting at its default")
    unit = unit_for(path)
    clock = MonotonicClock()
    installation = Installation(
        settings,
        environment_of(unit, os.environ),
        clock,
        unit,
        ports=partial(make_ports, settings, clock),
    )
    yield from check_installation(installation)


def _table(findings: list[Finding]) -> Table:
    table = Table(box=None, pad_edge=False, show_header=False)
    for finding in findings:
        said = Text(finding.text)
        if finding.remedy:
            said.append(f"\n  remedy: {finding.remedy}", style="bold")
        table.add_row(MARKS[finding.level], Text(finding.subject), said)
    return table
