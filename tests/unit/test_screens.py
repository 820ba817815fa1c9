"""Touchscreens by configuration: what they are called, where they lie, what `check` says."""

from pathlib import Path

import pytest

from cornertouchd.config import (
    CamerasSettings,
    ConfigError,
    ScreenSettings,
    Settings,
    SurfaceSettings,
    read_settings,
)
from cornertouchd.devices.uinput_device import ScreenError
from cornertouchd.guiding.finding import Finding
from cornertouchd.runtime.checks import screens as check
from cornertouchd.runtime.checks.installation import Installation
from cornertouchd.runtime.screens import make_screens, screen_names
from cornertouchd.simulation.clock import SimulatedClock
from cornertouchd.wire.tuio import default_source_name

SURFACE_MM = (600.0, 400.0)


def settings_with(*screens: ScreenSettings) -> Settings:
    return Settings(
        surface=SurfaceSettings(width_mm=SURFACE_MM[0], height_mm=SURFACE_MM[1]),
        cameras=CamerasSettings(source="simulated"),
        screens=screens,
    )


ON = ScreenSettings(enabled=True)


def test_there_is_none_unless_one_is_wanted() -> None:
    assert make_screens(Settings(), SURFACE_MM, "") == ()
    (sink,) = make_screens(settings_with(ON), SURFACE_MM, "/etc/cornertouchd/cornertouchd.toml")
    assert [screen.name for screen in sink.screens] == ["cornertouchd"]


def test_two_daemons_on_one_machine_keep_to_names_of_their_own() -> None:
    files = [f"/etc/cornertouchd/{name}.toml" for name in ("cornertouchd", "left", "right")]
    names = [name for file in files for name in screen_names(settings_with(ON), file)]
    assert names == ["cornertouchd", "cornertouchd left", "cornertouchd right"]
    assert len({default_source_name("kiosk", file, "127.0.0.1") for file in files}) == len(files)


def test_two_displays_of_a_surface_are_two_touchscreens() -> None:
    left = ScreenSettings(enabled=True, display="left", display_width_mm=300.0)
    right = ScreenSettings(enabled=True, display="right", display_left_mm=300.0)
    sinks = make_screens(settings_with(left, right), SURFACE_MM, "")
    assert [sink.screens[0].name for sink in sinks] == ["cornertouchd left", "cornertouchd right"]


def test_names_that_are_set_are_kept_and_others_are_made_different() -> None:
    mine = ScreenSettings(enabled=True, name="shop window")
    assert screen_names(settings_with(ON, mine, ON), "") == [
        "cornertouchd",
        "shop window",
        "cornertouchd 3",
    ]


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ('[[screens]]\nname = "a"\n[[screens]]\nname = "a"\n', r"number 2: name = .a. is that of"),
        ("[[screens]]\ndisplay_left_mm = 400.0\n", r"\[\[screens\]\] number 1: display_left_mm"),
        ("screens = 3\n", r"at most 8 tables, each written as \[\[screens\]\]"),
        ('[[screens]]\ndisplay = "a/b"\n', r"up to 32 letters"),
        ("[[screens]]\ntouches_max = 0\n", r"touches_max = 0: must be a whole number from 1 to 60"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, lines: str, told: str) -> None:
    file = tmp_path / "kiosk.toml"
    file.write_text(lines)
    with pytest.raises(ConfigError, match=told):
        read_settings(file)


def findings(settings: Settings, allowed: str = "/dev/uinput rw") -> list[Finding]:
    unit = {"LoadState": "loaded", "DeviceAllow": allowed}

    def output_of(*command: str) -> str:
        name = command[-1].removeprefix("--property=")
        return f"{name}={unit.get(name, '')}\n"

    installation = Installation(settings, {}, SimulatedClock(), output_of=output_of)
    return list(check.screens_of(installation))


def test_check_says_nothing_of_touchscreens_that_nobody_wants() -> None:
    assert findings(Settings()) == []


def test_check_tells_that_touchscreens_can_be_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "require_uinput", lambda _: None)
    (finding,) = findings(settings_with(ON, ON))
    assert (finding.level, finding.text) == ("ok", "2 touchscreens can be made by this user")


def test_check_tells_what_keeps_them_from_being_made(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> None:
        raise ScreenError("/dev/uinput: Permission denied; be in the group")

    monkeypatch.setattr(check, "require_uinput", refuse)
    mine, of_unit = findings(settings_with(ON), allowed="char-video4linux rw")
    assert (mine.level, mine.remedy) == ("error", "be in the group")
    assert of_unit.text == "cornertouchd.service may not open /dev/uinput"
    assert "screens.conf /etc/systemd/system/cornertouchd.service.d/screens.conf" in of_unit.remedy
