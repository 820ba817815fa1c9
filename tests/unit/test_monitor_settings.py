"""The live page's settings: whoever opens it to others must guard it."""

from pathlib import Path

import pytest

from cornertouchd.config import ConfigError, MonitorSettings, read_settings

TOKEN = "0123456789abcdef"


@pytest.fixture
def read(tmp_path: Path):
    def write_and_read(*lines: str) -> MonitorSettings:
        path = tmp_path / "touch.toml"
        path.write_text("\n".join(["[monitor]", *lines]))
        return read_settings(path).monitor

    return write_and_read


def test_by_default_the_page_is_for_this_machine_and_for_looking_only(read):
    monitor = read()
    assert monitor.enabled
    assert (monitor.host, monitor.port) == ("127.0.0.1", 8333)
    assert not monitor.allow_actions


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "kiosk.local", "127.0.0.1.evil"])
def test_a_page_that_others_reach_needs_a_token(read, host):
    with pytest.raises(ConfigError, match="needs a token; set one"):
        read(f'host = "{host}"')
    assert read(f'host = "{host}"', f'token = "{TOKEN}"').token == TOKEN


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_a_page_for_this_machine_needs_none(read, host):
    assert read(f'host = "{host}"').is_for_this_machine_only


def test_a_page_that_is_off_needs_none(read):
    assert not read('host = "0.0.0.0"', "enabled = false").enabled


@pytest.mark.parametrize("token", ["short", TOKEN[:-1], TOKEN + "é", TOKEN + " ", TOKEN + ";"])
def test_a_token_that_is_short_or_fits_no_header_is_refused(read, token):
    with pytest.raises(ConfigError, match="16 to 256 letters, digits and"):
        read(f'token = "{token}"')


def test_every_wrong_name_is_told_by_its_number(read):
    with pytest.raises(ConfigError) as refusal:
        read('names = ["kiosk.local", "a b", "evil/", 3]')
    assert [line.split(": ", 1)[1] for line in str(refusal.value).splitlines()] == [
        '[monitor] names number 2 = "a b": must be a host name in quotes',
        '[monitor] names number 3 = "evil/": must be a host name in quotes',
        "[monitor] names number 4 = 3: must be a host name in quotes",
    ]
