"""The commands, one file each."""

import gc
import os
from importlib import import_module

import click

from cornertouchd.cli.journal import log_to_stderr
from cornertouchd.errors import ReportedError

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when a command imports numpy
"""Our matrices are small: threads would wait for each other far longer than they work."""

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # AV_LOG_QUIET
"""What is wrong with a video is said by us, with the file's name and what to do."""

COMMANDS = {
    "bench": "Measure what this machine carries: microseconds per stage.",
    "calibrate": "Calibrate the cameras and save the result.",
    "cameras": "Show what cameras there are and bind them to corners.",
    "check": "Look at everything that can be wrong, and say what to do.",
    "demo": "Simulate a rig with moving fingers and send its touches as TUIO.",
    "leds": "Look at the LED frame, try it out, write its firmware.",
    "listen": "Show the touches that a TUIO tracker sends, whichever it is.",
    "record": "Record the running daemon, or the cameras, into a directory.",
    "replay": "Replay a recording through the whole pipeline.",
    "report": "Gather everything that helps to help in one zip.",
    "run": "Run the daemon: cameras in, TUIO out, until SIGINT or SIGTERM.",
    "status": "Tell how the running daemon does.",
}
"""What each command does.  A command is imported when it is called, with what it needs: compiled
kernels, OpenCV."""


class _Commands(click.Group):
    """Imports commands when they are needed; tells errors in one line, with exit status 1."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        log_to_stderr()
        gc.disable()  # looks in vain for rubbish among modules: a tenth of the time that they take
        command: click.Command = getattr(import_module(f"cornertouchd.cli.{cmd_name}"), cmd_name)
        gc.enable()
        return command

    def format_commands(
        self,
        ctx: click.Context,  # noqa: ARG002
        formatter: click.HelpFormatter,
    ) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except ReportedError as error:
            raise click.ClickException(str(error)) from error


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="cornertouchd")
def main() -> None:
    """Multi-touch from four infrared corner cameras, spoken as TUIO 1.1."""
