"""`cornertouchd leds`: look at the LED frame and try it out, beside a stopped daemon."""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from cornertouchd.config import LedFrameSettings, Settings, find_settings, read_settings
from cornertouchd.runtime.led_desk import SHINES_WITHIN_S, LedDesk, LedFrameError, light_of
from cornertouchd.runtime.led_flashing import write_firmware
from cornertouchd.runtime.stop_signal import StopSignal
from cornertouchd.wire.ledframe import (
    SIDE_NAMES,
    ClearFaults,
    Fault,
    SelfTest,
    State,
)
from cornertouchd.wire.ledframe_faults import explain
from cornertouchd.wire.ledframe_reports import SelfTested
from cornertouchd.wire.ledframe_session import Light

SELF_TEST_S = 10.0
BOOTLOADER_BAUD = 115_200
CHECKOUT = Path(__file__).resolve().parents[2]
IMAGES = (
    CHECKOUT / "firmware" / "build" / "ledframe.hex",
    Path("/usr/share/cornertouchd/ledframe.hex"),
)
"""Where the firmware's image is, built or installed."""


@dataclass(frozen=True, slots=True)
class _Chosen:
    """Settings, and the port that a command goes to."""

    settings: Settings
    port: str

    def light(self, led_frame: LedFrameSettings) -> Light:
        """Return how the LED frame is to shine."""
        return light_of(led_frame, self.settings.cameras.rate_hz)


@click.group()
@click.option("--port", help="Serial port; else led_frame.port of the settings.")
@click.option(
    "--config",
    "config_file",
    type=click.Path(path_type=Path),
    help="Settings; else $CORNERTOUCHD_CONFIG, else /etc/cornertouchd/cornertouchd.toml.",
)
@click.pass_context
def leds(context: click.Context, port: str | None, config_file: Path | None) -> None:
    """Look at the LED frame, try it out, write its firmware.

    The daemon holds the port while it runs: stop it first.
    """
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    context.obj = _Chosen(settings, port or settings.led_frame.port)


@leds.command()
@click.option("--json", "as_json", is_flag=True, help="The same as a JSON object.")
@click.pass_obj
def status(chosen: _Chosen, as_json: bool) -> None:
    """Show who answers, how it is, and its faults with what to do.

    Exit status 1 if it has faults.
    """
    with LedDesk(chosen.port) as desk:
        told = _told(desk, chosen.port)
    _show(told, as_json)
    sys.exit(bool(told["faults"]))


@leds.command()
@click.argument("level", type=click.IntRange(0, 255))
@click.option("--side", type=click.Choice(SIDE_NAMES), help="This side only.")
@click.option("--seconds", type=click.FloatRange(min=0.0), help="End after so long.")
@click.pass_obj
def level(chosen: _Chosen, level: int, side: str | None, seconds: float | None) -> None:
    """Shine at LEVEL, 0 to 255, until Ctrl-C."""
    levels = {f"level_{name}": level if side in (None, name) else 0 for name in SIDE_NAMES} | {
        "pattern": "constant"
    }
    _shine(chosen, chosen.settings.led_frame.model_copy(update=levels), seconds)


@leds.command()
@click.argument("pattern", type=click.Choice(["constant", "ambient", "sides"]))
@click.option("--seconds", type=click.FloatRange(min=0.0), help="End after so long.")
@click.pass_obj
def pattern(chosen: _Chosen, pattern: str, seconds: float | None) -> None:
    """Shine in a pattern, with the levels of the settings, until Ctrl-C."""
    led_frame = chosen.settings.led_frame.model_copy(update={"pattern": pattern})
    _shine(chosen, led_frame, seconds)


@leds.command("self-test")
@click.option("--json", "as_json", is_flag=True, help="The result as a JSON object.")
@click.pass_obj
def self_test(chosen: _Chosen, as_json: bool) -> None:
    """Light one side after the other and measure its current.

    Exit status 1 if a side does not draw it.
    """
    with LedDesk(chosen.port) as desk:
        desk.ask(SelfTest())
        failed = desk.wait_for(SelfTested, SELF_TEST_S).sides_failed
    result = {name: "failed" if name in failed else "passed" for name in SIDE_NAMES}
    _show(
        {f"{name} side": said for name, said in result.items()} if not as_json else result, as_json
    )
    if failed:
        click.echo(
            f"no light on: {', '.join(failed)}; look for an open LED, a loose plug or a missing "
            "supply",
            err=True,
        )
    sys.exit(bool(failed))


@leds.command()
@click.pass_obj
def off(chosen: _Chosen) -> None:
    """Switch the light off and clear faults that have been mended."""
    with LedDesk(chosen.port) as desk:
        desk.wait_until(_is(State.IDLE, State.SAFE), SHINES_WITHIN_S)
        faults = desk.status.controller.faults if desk.status.controller else Fault(0)
        if faults:
            desk.ask(ClearFaults(faults))
            desk.wait_until(_is(State.IDLE), SHINES_WITHIN_S)
    click.echo(f"{chosen.port}: dark", err=True)


@leds.command()
@click.option(
    "--image", type=click.Path(dir_okay=False, path_type=Path), help="The firmware, ledframe.hex."
)
@click.option(
    "--baud",
    type=click.IntRange(min=1),
    default=BOOTLOADER_BAUD,
    show_default=True,
    help="Of the bootloader; 57600 for the old one of a Nano.",
)
@click.pass_obj
def flash(chosen: _Chosen, image: Path | None, baud: int) -> None:
    """Write the firmware to an Arduino Uno or Nano, by avrdude."""
    chosen_image = image or next((one for one in IMAGES if one.exists()), IMAGES[0])
    write_firmware(
        chosen.port, chosen_image, baud, lambda said: click.echo(said, err=True, nl=False)
    )
    click.echo(f"{chosen.port}: {chosen_image} is written", err=True)


def _shine(chosen: _Chosen, led_frame: LedFrameSettings, seconds: float | None) -> None:
    with StopSignal() as stop, LedDesk(chosen.port, chosen.light(led_frame)) as desk:
        desk.wait_until_it_shines()
        levels = ", ".join(
            f"{name} {level}" for name, level in zip(SIDE_NAMES, led_frame.levels, strict=True)
        )
        click.echo(
            f"{chosen.port}: shines, {led_frame.pattern}, {levels}; Ctrl-C ends it", err=True
        )
        waited_s = 0.0
        while not stop.wait(0.25) and (seconds is None or waited_s < seconds):
            waited_s += 0.25
            desk.wait_until_it_shines()


def _is(*states: State) -> Callable[[Any], bool]:
    return lambda status: status.controller is not None and status.controller.state in states


def _told(desk: LedDesk, port: str) -> dict[str, Any]:
    identity, controller = desk.status.identity, desk.status.controller
    if identity is None or controller is None:
        raise LedFrameError(f"{port}: it has just been lost; look at its cable")
    return {
        "port": port,
        "firmware": ".".join(map(str, identity.firmware)),
        "protocol": ".".join(map(str, identity.protocol)),
        "start": identity.boot_id,
        "state": controller.state.name.lower(),
        "temperature_c": controller.temperature_c,
        "uptime_s": controller.uptime_ms / 1000,
        "frames": controller.frame,
        "faults": explain(controller.faults),
        "bad_messages": controller.bad_crc + controller.malformed + controller.overflows,
    }


def _show(told: dict[str, Any], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(told, indent=2))
        return
    table = Table(box=None, pad_edge=False, show_header=False)
    for name, value in told.items():
        said = "\n".join(value) or "none" if isinstance(value, list) else str(value)
        table.add_row(name.replace("_", " "), said)
    Console().print(table)
