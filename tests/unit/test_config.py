"""Settings: what a file may say, what it means, and where it is looked for."""

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from cornertouchd.config import (
    CameraSettings,
    ConfigError,
    DestinationSettings,
    Settings,
    SurfaceSettings,
    TcpSettings,
    WebSocketSettings,
    find_settings,
    read_settings,
    render_default_toml,
)
from cornertouchd.config import reading as reading_module
from cornertouchd.config.layout import keys_of, tables_of
from cornertouchd.config.rig import CAMERA_IDS

SHIPPED_FILE = Path(__file__).parents[2] / "config" / "cornertouchd.toml"


@pytest.fixture
def read(tmp_path):
    """Write a file and read it."""

    def write_and_read(content):
        path = tmp_path / "touch.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_settings(path)

    return write_and_read


class TestTheShippedFile:
    def test_is_what_the_program_renders(self):
        assert SHIPPED_FILE.read_text(encoding="utf-8") == render_default_toml()

    def test_means_the_defaults(self):
        assert read_settings(SHIPPED_FILE) == Settings()

    def test_means_the_defaults_with_every_key_uncommented(self, read):
        uncommented = re.sub(r"(?m)^#(\w+ = )", r"\1", render_default_toml())
        assert uncommented.count("\nwidth_px = 640\n") == 1
        assert read(uncommented) == Settings()

    def test_has_every_key_of_every_table(self):
        sections = re.split(r"(?m)^(?=\[)", render_default_toml())[1:]
        written = [re.findall(r"(?m)^#(\w+) = ", section) for section in sections]
        tables = [table for location, table in tables_of(Settings()) if location]
        inner = {"paper", "destinations", "websocket", "tcp", *CAMERA_IDS}
        expected = [[key for key in keys_of(type(table)) if key not in inner] for table in tables]
        assert written == expected

    def test_tells_bounds_and_unit(self):
        assert "# Allowed: a number from 100.0 to 10000.0 mm.\n#width_mm = 350.0" in (
            render_default_toml()
        )

    def test_describes_every_setting(self):
        for location, table in tables_of(Settings()):
            for key, field in type(table).model_fields.items():
                is_table = key in {"paper", "websocket", "tcp"}
                assert field.description or not location or is_table, (location, key)


class TestReading:
    def test_an_empty_file_means_the_defaults(self, read):
        assert read("") == Settings()

    def test_what_is_given_counts_and_the_rest_keeps_its_default(self, read):
        settings = read("[surface]\nwidth_mm = 2400\n[vision.paper]\nt1 = 11.5\n")
        assert settings.surface == SurfaceSettings(width_mm=2400.0)
        assert isinstance(settings.surface.width_mm, float)
        assert settings.vision.paper.t1 == 11.5
        assert settings.vision.paper.t3_px == 120.0

    def test_there_are_four_cameras_with_their_own_devices(self):
        assert [(name, unit.device) for name, unit in Settings().cameras.units.items()] == [
            ("C1", "/dev/cornertouch/c1"),
            ("C2", "/dev/cornertouch/c2"),
            ("C3", "/dev/cornertouch/c3"),
            ("C4", "/dev/cornertouch/c4"),
        ]

    def test_one_value_of_a_camera_leaves_the_others_of_it_alone(self, read):
        units = read("[cameras.C3]\nrow_offset_px = 205\nrows_px = 64\n").cameras.units
        assert units["C3"] == CameraSettings(
            device="/dev/cornertouch/c3", row_offset_px=205, rows_px=64
        )
        assert units["C4"] == Settings().cameras.units["C4"]

    def test_further_cameras_exist_when_they_are_written(self, read):
        cameras = read("[cameras.C6]\n[cameras.C5]\ndevice = '/dev/video9'\n").cameras
        assert list(cameras.units) == ["C1", "C2", "C3", "C4", "C5", "C6"]
        assert cameras.units["C5"].device == "/dev/video9"
        assert cameras.units["C6"].device == "/dev/cornertouch/c6"

    def test_a_camera_can_be_taken_out(self, read):
        cameras = read("[cameras.C2]\nenabled = false\n").cameras
        assert cameras.enabled_ids == ("C1", "C3", "C4")

    def test_controls_of_a_camera_lie_over_those_of_all(self, read):
        cameras = read(
            "[cameras.controls]\ngain = 0\npower_line_frequency = '50 Hz'\n"
            "[cameras.C3]\ncontrols = { gain = 8, strobe = true }\n"
        ).cameras
        assert cameras.controls_of("C1") == {"gain": 0, "power_line_frequency": "50 Hz"}
        assert cameras.controls_of("C3") == {
            "gain": 8,
            "power_line_frequency": "50 Hz",
            "strobe": True,
        }

    def test_one_destination_without_any_and_none_on_request(self, read):
        assert read("").tuio.destinations == (DestinationSettings(),)
        assert read("[tuio]\ndestinations = []\n").tuio.destinations == ()

    def test_several_destinations(self, read):
        tuio = read(
            "[[tuio.destinations]]\nhost = 'wall'\n"
            "[[tuio.destinations]]\nport = 3334\nrotation_deg = 270\nmirror = true\n"
        ).tuio
        assert tuio.destinations == (
            DestinationSettings(host="wall"),
            DestinationSettings(port=3334, rotation_deg=270, mirror=True),
        )

    def test_servers_each_with_a_display_and_profiles_of_their_own(self, read):
        tuio = read(
            "[tuio.websocket]\nenabled = true\norigins = ['null', 'https://kiosk.example']\n"
            "[tuio.tcp]\nenabled = true\nport = 3334\nrotation_deg = 90\n"
            "profiles = ['2Dcur', '2Dblb']\n"
            "[[tuio.destinations]]\ntransport = 'tcp'\nprofiles = ['2Dblb']\n"
        ).tuio
        assert tuio.websocket == WebSocketSettings(
            enabled=True, origins=("null", "https://kiosk.example")
        )
        assert tuio.tcp == TcpSettings(
            enabled=True, port=3334, rotation_deg=90, profiles=("2Dcur", "2Dblb")
        )
        assert tuio.destinations == (DestinationSettings(transport="tcp", profiles=("2Dblb",)),)

    def test_a_byte_order_mark_and_windows_lines_do_no_harm(self, read):
        assert read(b"\xef\xbb\xbf[surface]\r\nwidth_mm = 500.0\r\n").surface.width_mm == 500.0

    def test_settings_do_not_change(self):
        with pytest.raises(ValidationError):
            Settings().surface.width_mm = 1.0  # type: ignore[misc]


class TestFindingTheFile:
    @pytest.fixture
    def etc(self, tmp_path, monkeypatch):
        path = tmp_path / "etc" / "cornertouchd.toml"
        path.parent.mkdir()
        monkeypatch.setattr(reading_module, "SYSTEM_FILE", path)
        return path

    def test_the_command_line_comes_first_then_the_environment_then_etc(self, tmp_path, etc):
        given, named = tmp_path / "given.toml", tmp_path / "named.toml"
        environ = {"CORNERTOUCHD_CONFIG": str(named)}
        for path in (given, named, etc):
            path.touch()
        assert find_settings(given, environ) == given
        assert find_settings(None, environ) == named
        assert find_settings(None, {}) == etc
        assert find_settings(None, {"CORNERTOUCHD_CONFIG": ""}) == etc

    def test_without_any_file_the_defaults_count(self, etc):
        assert find_settings(None, {}) is None

    def test_a_file_that_may_not_be_looked_at_is_not_passed_over(self, etc, monkeypatch):
        def refuse(path):
            raise PermissionError(13, "Permission denied", str(path))

        monkeypatch.setattr(Path, "exists", refuse)
        assert find_settings(None, {}) == etc

    def test_the_place_in_etc(self):
        assert Path("/etc/cornertouchd/cornertouchd.toml") == reading_module.SYSTEM_FILE

    def test_a_file_that_was_asked_for_must_exist(self, tmp_path, etc):
        etc.touch()
        missing = tmp_path / "missing.toml"
        with pytest.raises(ConfigError, match=r"missing\.toml: no such file, given on the command"):
            find_settings(missing, {})
        with pytest.raises(
            ConfigError, match=r"missing\.toml: no such file, named by \$CORNERTOUCHD"
        ):
            find_settings(None, {"CORNERTOUCHD_CONFIG": str(missing)})
