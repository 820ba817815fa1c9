"""Errors of configuration files: all told at once, each with table, key, value and bound."""

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from cornertouchd.config import (
    CameraSettings,
    CamerasSettings,
    ConfigError,
    DestinationSettings,
    Settings,
    TuioSettings,
    read_settings,
)

AT_MOST_16_TABLES = "must be at most 16 tables, each written as [[tuio.destinations]]"


@pytest.fixture
def read(tmp_path):
    """Write a file and read it."""

    def write_and_read(content):
        path = tmp_path / "touch.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_settings(path)

    return write_and_read


@pytest.fixture
def errors_of(read, tmp_path):
    """Write a file and return the lines of its error, without the file's name in front."""

    def write_and_refuse(content):
        with pytest.raises(ConfigError) as refusal:
            read(content)
        lines = str(refusal.value).split("\n")
        name = f"{tmp_path / 'touch.toml'}: "
        assert all(line.startswith(name) for line in lines)
        return [line.removeprefix(name) for line in lines]

    return write_and_refuse


class TestErrors:
    def test_a_value_out_of_bounds_is_named_with_its_bounds(self, errors_of):
        assert errors_of("[tracking]\ngate_mm = -3\n") == [
            "[tracking] gate_mm = -3: must be a number from 0.1 to 1000.0 mm"
        ]

    @pytest.mark.parametrize(
        ("line", "shown"),
        [
            ('width_mm = "350"', '"350"'),
            ("width_mm = true", "true"),
            ("width_mm = nan", "nan"),
            ("width_mm = -inf", "-inf"),
            ("width_mm = 2020-01-01", "2020-01-01"),
            ("width_mm = [350]", "(an array)"),
            ("width_mm = {mm = 350}", "(a table)"),
            (f"width_mm = 0x{'f' * 5000}", f"0x{'f' * 55}..."),
            (f'width_mm = "{"w" * 5000}"', f'"{"w" * 56}...'),
        ],
    )
    def test_other_types_are_refused_not_converted(self, errors_of, line, shown):
        assert errors_of(f"[surface]\n{line}\n") == [
            f"[surface] width_mm = {shown}: must be a number from 100.0 to 10000.0 mm"
        ]

    @pytest.mark.parametrize("table", ["cameras", "cameras.C2"])
    def test_a_control_that_no_camera_takes_is_named(self, errors_of, table):
        assert errors_of(f"[{table}.controls]\ngain = 1.5\nstrobe = true\nfocus = []\n") == [
            f"[{table}.controls] {key} = {value}: must be a whole number, true, false, or the name "
            "of a choice in quotes"
            for key, value in (("gain", "1.5"), ("focus", "(an array)"))
        ]
        (line,) = errors_of(f"[{table}]\ncontrols = 7\n")
        assert line == f"[{table}] controls = 7: must be a table of names and values"

    @pytest.mark.parametrize("value", ["45", "90.0", "false", '"90"'])
    def test_rotations_are_quarter_turns(self, errors_of, value):
        (line,) = errors_of(f"[[tuio.destinations]]\nrotation_deg = {value}\n")
        assert line.startswith(f"[[tuio.destinations]] number 1 rotation_deg = {value}: ")
        assert line.endswith("must be one of 0, 90, 180, 270 degrees")

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            ("surface = 3", "surface = 3: must be a table, written as [surface]"),
            ("[[surface]]", "surface = (an array): must be a table, written as [surface]"),
            ("cameras = 3", "cameras = 3: must be a table, written as [cameras]"),
            (
                "[cameras]\nC2 = true",
                "[cameras] C2 = true: must be a table, written as [cameras.C2]",
            ),
            (
                "[tuio]\ndestinations = 'wall'",
                f'[tuio] destinations = "wall": {AT_MOST_16_TABLES}',
            ),
            (
                "[tuio]\ndestinations = [{}, 'wall']",
                f'[[tuio.destinations]] number 2 = "wall": {AT_MOST_16_TABLES}',
            ),
            (
                "[[tuio.destinations]]\n" * 17,
                f"[tuio] destinations = (an array): {AT_MOST_16_TABLES}",
            ),
        ],
    )
    def test_a_value_in_the_place_of_a_table(self, errors_of, content, message):
        assert errors_of(content) == [message]

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (
                "[surface]\nwidht_mm = 1",
                "[surface] widht_mm = 1: unknown key; did you mean width_mm?",
            ),
            ("[trakking]", "trakking = (a table): unknown key; did you mean tracking?"),
            ("[cameras.c1]", "[cameras] c1 = (a table): unknown key; did you mean C1?"),
            (
                "[cameras.C5]\ndevise = 'x'",
                '[cameras.C5] devise = "x": unknown key; did you mean device?',
            ),
            (
                "[tuio]\nport = 3333",
                "[tuio] port = 3333: unknown key; did you mean port in [[tuio.destinations]]?",
            ),
            (
                "[surface]\nzzz = 1",
                "[surface] zzz = 1: unknown key; known here: width_mm, height_mm",
            ),
            (
                '[surface]\n"a\\nb" = 1',
                '[surface] "a\\nb" = 1: unknown key; known here: width_mm, height_mm',
            ),
        ],
    )
    def test_an_unknown_key_is_named_with_the_nearest_known(self, errors_of, content, message):
        assert errors_of(content) == [message]

    def test_there_are_no_more_than_eight_cameras(self, errors_of):
        (line,) = errors_of("[cameras.C9]")
        assert line.startswith("[cameras] C9 = (a table): unknown key;")

    def test_our_inner_name_for_the_cameras_is_no_key(self, errors_of):
        (line,) = errors_of("[cameras.units.C1]\nrows_px = 3\n")
        assert line.startswith("[cameras] units = (a table): unknown key")

    def test_all_errors_are_told_at_once(self, errors_of):
        lines = errors_of(
            "sorface = 1\n"
            "[surface]\nwidth_mm = 0\nheight_mm = 'tall'\n"
            "[cameras]\nrate_hz = 0.0\nhight_px = 3\n"
            "[cameras.C1]\nenabled = 1\n"
            "[cameras.C2]\nrow_offset_px = 479\nrows_px = 2\n"
            "[pairing]\ntolerance_ms = 20.0\n"
            "[[tuio.destinations]]\n[[tuio.destinations]]\nport = 0\n"
        )
        assert [line.split(" = ")[0] for line in lines] == [
            "[surface] width_mm",
            "[surface] height_mm",
            "[cameras] rate_hz",
            "[cameras.C1] enabled",
            "[cameras] hight_px",
            "[[tuio.destinations]] number 2 port",
            "sorface",
            "[cameras.C2] row_offset_px",
            "[pairing] tolerance_ms",
        ]

    def test_nothing_is_concluded_from_a_value_that_is_wrong_itself(self, errors_of):
        lines = errors_of(
            "[cameras]\nheight_px = '1080'\n[cameras.C1]\nrow_offset_px = 900\nrows_px = 64\n"
        )
        assert [line.split(" = ")[0] for line in lines] == ["[cameras] height_px"]

    def test_nothing_is_concluded_from_a_table_that_is_wrong_itself(self, errors_of):
        lines = errors_of("surface = 3\n[[tuio.destinations]]\ndisplay_width_mm = 2000\n")
        assert [line.split(" = ")[0] for line in lines] == ["surface"]

    def test_destinations_keep_their_numbers_when_one_is_wrong(self, errors_of):
        lines = errors_of("[tuio]\ndestinations = ['wall', {display_width_mm = 2000}]\n")
        assert len(lines) == 2
        assert lines[0].startswith('[[tuio.destinations]] number 1 = "wall"')
        assert lines[1].startswith("[[tuio.destinations]] number 2: display_left_mm")


class TestContradictions:
    @pytest.mark.parametrize("band", [(0, 480), (416, 64), (479, 0), (479, 1)])
    def test_bands_within_the_picture_are_accepted(self, read, band):
        read(f"[cameras.C1]\nrow_offset_px = {band[0]}\nrows_px = {band[1]}\n")

    @pytest.mark.parametrize("band", [(0, 481), (417, 64), (480, 0)])
    def test_bands_below_the_picture_are_refused(self, errors_of, band):
        (line,) = errors_of(f"[cameras.C1]\nrow_offset_px = {band[0]}\nrows_px = {band[1]}\n")
        assert f"[cameras.C1] row_offset_px = {band[0]} and rows_px = {band[1]}" in line
        assert "height_px = 480" in line

    def test_a_picture_must_come_before_the_camera_counts_as_silent(self, errors_of, read):
        read("[cameras]\nrate_hz = 2.0\nread_timeout_s = 0.5\n")
        (line,) = errors_of("[cameras]\nrate_hz = 1.5\nread_timeout_s = 0.5\n")
        assert line == (
            "[cameras] read_timeout_s = 0.5 ends before the next picture comes, at rate_hz = 1.5; "
            "raise one of them"
        )

    @pytest.mark.parametrize("display", [(0.0, 0.0), (349.0, 0.0), (0.0, 350.0), (100.0, 250.0)])
    def test_displays_on_the_surface_are_accepted(self, read, display):
        read(
            f"[[tuio.destinations]]\ndisplay_left_mm = {display[0]}\n"
            f"display_width_mm = {display[1]}\n"
        )

    @pytest.mark.parametrize("display", [(350.0, 0.0), (0.0, 350.1), (100.0, 250.1)])
    def test_displays_beyond_the_surface_are_refused(self, errors_of, display):
        (line,) = errors_of(
            "[[tuio.destinations]]\nport = 3334\n"
            f"[[tuio.destinations]]\ndisplay_left_mm = {display[0]}\n"
            f"display_width_mm = {display[1]}\n"
        )
        assert line.startswith(f"[[tuio.destinations]] number 2: display_left_mm = {display[0]}")
        assert "[surface] width_mm = 350.0" in line

    def test_a_destination_that_is_told_twice_is_refused(self, errors_of):
        (line,) = errors_of("[[tuio.destinations]]\n[[tuio.destinations]]\nmirror = true\n")
        assert "number 2: 127.0.0.1:3333 is number 1, too" in line

    def test_the_same_place_over_two_transports_is_told_by_both(self, read):
        read("[[tuio.destinations]]\n[[tuio.destinations]]\ntransport = 'tcp'\n")

    def test_servers_need_ports_of_their_own(self, errors_of, read):
        both = "[tuio.tcp]\nenabled = true\nport = 8080\n[tuio.websocket]\n"
        read(both)
        (line,) = errors_of(f"{both}enabled = true\n")
        assert line == (
            "[tuio.tcp] port = 8080 is that of [tuio.websocket], too; give each its own"
        )

    def test_the_display_of_a_server_lies_on_the_surface(self, errors_of):
        (line,) = errors_of("[tuio.tcp]\ndisplay_left_mm = 350.0\n")
        assert line.startswith("[tuio.tcp]: display_left_mm = 350.0 and")

    @pytest.mark.parametrize("origin", ["kiosk", "http://kiosk/page", "http:// kiosk", ""])
    def test_what_is_no_origin_is_refused(self, errors_of, origin):
        (line,) = errors_of(f"[tuio.websocket]\norigins = ['*', '{origin}']\n")
        assert line.startswith(f'[tuio.websocket] origins number 2 = "{origin}": must be origins')

    @pytest.mark.parametrize(
        "profiles", ["['2Dobj']", "['2Dcur', '2Dcur']", "[]", "'2Dcur'"], ids=str
    )
    def test_profiles_that_there_are_not_are_refused(self, errors_of, profiles):
        (line,) = errors_of(f"[tuio.tcp]\nprofiles = {profiles}\n")
        assert line.startswith("[tuio.tcp] profiles")
        assert line.endswith('must be ["2Dcur"], ["2Dblb"] or ["2Dcur", "2Dblb"]')

    def test_decimal_fractions_that_fill_the_surface_fit(self, read):
        assert 256.1 + 100.1 > 356.2  # the sum that must not matter
        read(
            "[surface]\nheight_mm = 356.2\n"
            "[[tuio.destinations]]\ndisplay_top_mm = 256.1\ndisplay_height_mm = 100.1\n"
        )

    @pytest.mark.parametrize(
        ("content", "begins"),
        [
            ("[cameras]\nreopen_delay_s = 31.0", "[cameras] reopen_delay_s = 31.0 is more than"),
            ("[vision.paper]\nt2_px = 5.0\nt3_px = 4.0", "[vision.paper] t2_px = 5.0 is more than"),
            ("[pairing]\ndeadline_ms = 3.9", "[pairing] tolerance_ms = 4.0 is more than"),
            ("[crossing]\npen_diameter_mm = 30.0", "[crossing] pen_diameter_mm = 30.0 is more"),
            ("[vision]\nshadow_below = 0.4", "[vision] edge_level = 0.52 is more"),
            ("[crossing]\nlargest_radius_mm = 1.2", "[crossing] smallest_radius_mm = 1.5 is more"),
        ],
    )
    def test_a_lower_limit_above_its_upper_one_is_refused(self, errors_of, content, begins):
        (line,) = errors_of(content)
        assert line.startswith(begins)

    def test_a_lower_limit_may_equal_its_upper_one(self, read):
        read("[pairing]\ntolerance_ms = 5.0\ndeadline_ms = 5.0\n")

    def test_one_camera_alone_is_refused(self, errors_of):
        (line,) = errors_of(
            "".join(f"[cameras.C{number}]\nenabled = false\n" for number in (1, 2, 3))
        )
        assert "enabled = true: 1; must be at least 2" in line

    def test_two_cameras_on_one_device_are_refused(self, errors_of):
        (line,) = errors_of("[cameras.C4]\ndevice = '/dev/cornertouch/c2'\n")
        assert line.startswith('[cameras.C4] device = "/dev/cornertouch/c2" is that of C2')

    def test_a_camera_that_is_taken_out_may_share_its_device(self, read):
        read("[cameras.C4]\ndevice = '/dev/cornertouch/c2'\nenabled = false\n")

    def test_hold_for_settings_made_in_the_program_too(self):
        outside = TuioSettings(destinations=(DestinationSettings(display_top_mm=401.0),))
        with pytest.raises(ValidationError, match=r"number 1: display_top_mm = 401\.0"):
            Settings(tuio=outside)
        with pytest.raises(ValidationError, match="C1 to C8"):
            CamerasSettings(units={"left": CameraSettings(device="/dev/video0")})


class TestFilesThatCannotBeRead:
    def test_a_syntax_error_is_told_with_its_line(self, errors_of):
        (line,) = errors_of("[surface]\nwidth_mm = 350.0\nheight_mm 400.0\n")
        assert line.startswith("line 3, column ")

    def test_a_table_that_is_written_twice_is_told_with_its_line(self, errors_of):
        (line,) = errors_of("[surface]\n[tuio]\n[surface]\n")
        assert line.startswith("line 3, column ")

    def test_a_string_without_end_is_told_with_the_last_line(self, errors_of):
        (line,) = errors_of('[tuio]\nsource_name = """\nwall')
        assert line.startswith("line 3")

    def test_other_encodings_are_told_with_the_line(self, errors_of):
        (line,) = errors_of("[tuio]\n# Kiosk Köln\n".encode("latin-1"))
        assert line == "line 2: is not UTF-8; save the file as UTF-8"

    @pytest.mark.parametrize(
        "content", ["a = " + "[" * 5000, f"a = {'9' * 5000}", "a = 1979-99-99"]
    )
    def test_hostile_values_are_refused(self, errors_of, content):
        assert len(errors_of(content)) == 1

    def test_a_file_of_any_size_is_refused_early(self, errors_of):
        (line,) = errors_of(b"#" * 1_000_001)
        assert "larger than 1000000 bytes" in line

    def test_a_directory(self, tmp_path):
        with pytest.raises(ConfigError, match="cannot be read: Is a directory"):
            read_settings(tmp_path)

    @settings(deadline=None)
    @given(content=st.binary(max_size=200))
    def test_any_bytes_give_settings_or_a_config_error(self, tmp_path_factory, content):
        path = tmp_path_factory.mktemp("any") / "touch.toml"
        path.write_bytes(content)
        with contextlib.suppress(ConfigError):
            assert isinstance(read_settings(path), Settings)

    @settings(deadline=None)
    @given(
        table=st.sampled_from(
            ["surface", "cameras", "cameras.C1", "vision", "vision.paper", "tuio"]
        ),
        key=st.sampled_from(["width_mm", "rate_hz", "rows_px", "t1", "destinations", "C2", "zz"]),
        value=st.sampled_from(["0", "-1", "7.5", "1e308", "nan", "''", "[]", "{}", "[{}]", "true"]),
    )
    def test_any_value_at_any_place_gives_settings_or_a_config_error(
        self, tmp_path_factory, table, key, value
    ):
        path = tmp_path_factory.mktemp("any") / "touch.toml"
        path.write_text(f"[{table}]\n{key} = {value}\n")
        with contextlib.suppress(ConfigError):
            assert isinstance(read_settings(path), Settings)
