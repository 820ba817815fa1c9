"""Units and package say the same as the program that they come with."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SURFACE_OWN = {
    "Description=Multi-touch from corner cameras (cornertouchd)": (
        "Description=Multi-touch from corner cameras (cornertouchd, surface %i)"
    ),
    "ExecStart=/usr/bin/cornertouchd run --config /etc/cornertouchd/cornertouchd.toml": (
        "ExecStart=/usr/bin/cornertouchd run --config /etc/cornertouchd/%i.toml"
    ),
    "StateDirectory=cornertouchd": "StateDirectory=cornertouchd/%i",
    "RuntimeDirectory=cornertouchd": "RuntimeDirectory=cornertouchd/%i",
}
"""What the unit of one surface of several has of its own."""


def unit_lines(name: str) -> list[str]:
    lines = (ROOT / "systemd" / name).read_text().splitlines()
    return lines[lines.index("[Unit]") :]


def test_the_unit_of_a_surface_is_the_unit_but_for_its_names() -> None:
    assert [SURFACE_OWN.get(line, line) for line in unit_lines("cornertouchd.service")] == (
        unit_lines("cornertouchd@.service")
    )


def test_the_package_has_the_version_of_the_program() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    newest = (ROOT / "packaging/debian/changelog").read_text().splitlines()[0]
    assert re.fullmatch(rf"cornertouchd \({re.escape(project['version'])}(-\S+)?\) .*", newest)


def test_devices_and_directories_belong_to_the_user_of_the_unit() -> None:
    (user,) = re.findall(
        r"^u (\S+)", (ROOT / "systemd/cornertouchd.sysusers").read_text(), re.MULTILINE
    )
    unit = unit_lines("cornertouchd.service")
    assert f"User={user}" in unit
    assert f"Group={user}" in unit
    groups = set(
        re.findall(r'GROUP="(\S+?)"', (ROOT / "systemd/60-cornertouchd.rules").read_text())
    )
    assert groups == {user, "uinput"}
    assert f" {user} {user}" in (ROOT / "systemd/cornertouchd.tmpfiles").read_text()


def test_only_the_addition_to_the_units_opens_the_way_to_input_devices() -> None:
    addition = (ROOT / "systemd/screens.conf").read_text().splitlines()
    assert {"SupplementaryGroups=uinput", "DeviceAllow=/dev/uinput rw"} <= set(addition)
    for unit in ("cornertouchd.service", "cornertouchd@.service"):
        assert not any("/dev/uinput" in line for line in unit_lines(unit) if line[0:1] != "#")
    assert "g uinput -" in (ROOT / "systemd/cornertouchd.sysusers").read_text().splitlines()
    installed = (ROOT / "packaging/debian/cornertouchd.install").read_text()
    assert "systemd/screens.conf usr/share/cornertouchd" in installed
