"""Who may see the live page: others' pages, others' names for us and guesses are refused."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.monitor.access import Access, Asked
from cornertouchd.monitor.options import PageOptions

TOKEN = "0123456789abcdef"
LOCAL = PageOptions("/run/status.sock")
GUARDED = PageOptions("/run/status.sock", host="0.0.0.0", token=TOKEN)
HERE = "127.0.0.1:8333"


def asked(method="GET", path="/api/hello", cookies=None, **headers) -> Asked:
    given_headers = {"host": HERE, **{name.rstrip("_"): value for name, value in headers.items()}}
    return Asked(method, path, given_headers, cookies or {})


def reason(options: PageOptions, request: Asked) -> str | None:
    refusal = Access(options).refusal(request)
    return None if refusal is None else refusal.reason


class TestHost:
    @pytest.mark.parametrize(
        "host",
        ["127.0.0.1:8333", "localhost:8333", "LOCALHOST", "localhost.", "[::1]:8333", "[::1]"],
    )
    def test_names_of_this_machine_are_known(self, host):
        assert reason(LOCAL, asked(host=host)) is None

    @pytest.mark.parametrize(
        "host",
        [
            "",
            "evil.example",
            "127.0.0.1.evil.example",
            "localhost.evil.example:8333",
            "127.0.0.1:8333@evil.example",
            "evil.example:8333#localhost",
            "192.168.1.5:8333",
            "localhost:8333 ",
            "localhost\n",
            "[::1",
            "localhost:123456",
        ],
    )
    def test_other_names_are_refused_for_they_may_be_bound_to_our_address(self, host):
        assert reason(LOCAL, asked(host=host)) == "host"

    def test_a_request_without_a_host_is_refused(self):
        assert reason(LOCAL, Asked("GET", "/", {}, {})) == "host"

    def test_further_names_can_be_set(self):
        named = replace(LOCAL, names=("Kiosk.local",))
        assert reason(named, asked(host="kiosk.local:8333")) is None
        assert reason(named, asked(host="kiosk2.local:8333")) == "host"

    def test_a_page_at_one_address_is_known_by_that_one(self):
        bound = replace(GUARDED, host="192.168.1.5", token="")
        assert reason(bound, asked(host="192.168.1.5:8333")) is None
        assert reason(bound, asked(host="192.168.1.6:8333")) == "host"

    def test_a_page_at_all_addresses_is_known_by_any_of_them_but_by_no_other_name(self):
        open_to_all = replace(GUARDED, token="")
        assert reason(open_to_all, asked(host="192.168.1.5:8333")) is None
        assert reason(open_to_all, asked(host="[fe80::1]:8333")) is None
        assert reason(open_to_all, asked(host="evil.example")) == "host"

    @given(st.text(max_size=80))
    def test_whatever_else_it_says_it_is_refused(self, host):
        known = host.lower().split(":")[0].rstrip(".") in {"localhost", "127.0.0.1"}
        if not known and not host.startswith("[::1]"):
            assert reason(LOCAL, asked(host=host)) == "host"


class TestOrigin:
    @pytest.mark.parametrize("origin", [f"http://{HERE}", f"HTTP://{HERE}", f"https://{HERE}"])
    def test_this_page_may_watch_and_act(self, origin):
        assert reason(LOCAL, asked(path="/live", upgrade="websocket", origin=origin)) is None
        assert reason(LOCAL, asked("POST", "/api/save", origin=origin)) is None

    @pytest.mark.parametrize(
        "origin",
        [
            "null",
            "",
            "http://evil.example",
            "http://127.0.0.1",
            "http://127.0.0.1:8334",
            f"http://{HERE}.evil.example",
            f"http://evil.example/{HERE}",
            f"http://{HERE}@evil.example",
            f"file://{HERE}",
            "http://localhost:8333",
        ],
    )
    @pytest.mark.parametrize(
        "request_",
        [asked(path="/live", upgrade="websocket"), asked("POST", "/api/save"), asked()],
        ids=["watch", "act", "read"],
    )
    def test_pages_of_others_may_do_nothing(self, origin, request_):
        headers = {**request_.headers, "origin": origin}
        assert reason(LOCAL, replace(request_, headers=headers)) == "origin"

    def test_to_watch_and_to_act_the_origin_must_be_told(self):
        assert reason(LOCAL, asked(path="/live", upgrade="websocket")) == "origin"
        assert reason(LOCAL, asked("POST", "/api/save")) == "origin"

    def test_to_read_it_need_not_for_browsers_and_prometheus_do_not_tell_it(self):
        assert reason(LOCAL, asked(path="/metrics")) is None


class TestMethod:
    @pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "XYZ", ""])
    def test_only_reading_is_answered(self, method):
        assert reason(LOCAL, asked(method, origin=f"http://{HERE}")) == "method"

    def test_only_what_acts_can_be_posted_to(self):
        origin = f"http://{HERE}"
        assert reason(LOCAL, asked("POST", "/api/hello", origin=origin)) == "method"
        assert reason(LOCAL, asked("POST", "/", origin=origin)) == "method"


class TestToken:
    @pytest.mark.parametrize("path", ["/live", "/metrics", "/api/hello", "/api/save", "/else"])
    def test_without_it_nothing_is_told(self, path):
        assert reason(GUARDED, asked(path=path)) == "token"

    @pytest.mark.parametrize("path", ["/", "/page/main.js"])
    def test_without_it_the_page_itself_comes_for_it_has_the_form(self, path):
        assert reason(GUARDED, asked(path=path)) is None

    def test_it_can_be_a_bearer_token(self):
        assert reason(GUARDED, asked(authorization=f"Bearer {TOKEN}")) is None
        assert reason(GUARDED, asked(authorization=f"bearer  {TOKEN}")) is None

    @pytest.mark.parametrize(
        "given_token", ["", "Bearer", "Bearer ", f"Basic {TOKEN}", f"Bearer {TOKEN}0", TOKEN, "é"]
    )
    def test_a_wrong_one_is_refused(self, given_token):
        assert reason(GUARDED, asked(authorization=given_token)) == "token"

    def test_a_cookie_stands_for_it_and_does_not_tell_it(self):
        access = Access(GUARDED)
        carried = asked(cookies={access.cookie_name: access.cookie})
        assert access.refusal(carried) is None
        assert TOKEN not in access.cookie
        assert reason(GUARDED, asked(cookies={access.cookie_name: TOKEN})) == "token"
        assert reason(replace(GUARDED, token=TOKEN + "x"), carried) == "token"

    def test_cookies_of_two_pages_on_one_machine_do_not_mix(self):
        assert Access(GUARDED).cookie_name != Access(replace(GUARDED, port=8334)).cookie_name

    @given(st.text(max_size=40))
    def test_no_other_text_is_the_token(self, given_token):
        assert Access(GUARDED).knows_token(given_token) == (given_token == TOKEN)


def test_options_cross_to_the_process_as_they_are():
    options = replace(GUARDED, names=("a", "b"), allow_actions=True, recordings="/var/lib/x")
    assert PageOptions.from_line(options.as_line()) == options


@pytest.mark.parametrize(
    ("host", "address"),
    [
        ("127.0.0.1", "http://127.0.0.1:8333/"),
        ("0.0.0.0", "http://127.0.0.1:8333/"),
        ("::", "http://[::1]:8333/"),
        ("kiosk.local", "http://kiosk.local:8333/"),
    ],
)
def test_the_address_is_one_that_a_browser_here_can_open(host, address):
    assert replace(LOCAL, host=host).address == address
