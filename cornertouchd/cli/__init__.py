"""The commands, one file each."""

import click

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.cli.calibrate import calibrate
from cornertouchd.cli.demo import demo
from cornertouchd.cli.listen import listen
from cornertouchd.cli.record import record
from cornertouchd.cli.replay import replay
from cornertouchd.cli.run import run
from cornertouchd.config import ConfigError
from cornertouchd.devices.recording import RecordingError
from cornertouchd.ports import CameraError


class _Commands(click.Group):
    """Turns what went wrong into one message on stderr and exit status 1."""

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except (CalibrationError, CameraError, ConfigError, RecordingError) as error:
            raise click.ClickException(str(error)) from error


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="cornertouchd")
def main() -> None:
    """Multi-touch from four infrared corner cameras, spoken as TUIO 1.1."""


for _command in (demo, run, replay, calibrate, record, listen):
    main.add_command(_command)
