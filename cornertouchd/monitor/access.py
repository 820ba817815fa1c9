"""Who may see the page: which requests are refused, and why.

A page on this machine is within reach of every web page that its browsers show.  So the Host must
be a name of this machine (else a name of theirs may have been bound to our address: DNS rebinding),
an Origin must be this page's, and a token, if one is set, must be known.
"""

import hmac
import ipaddress
import re
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256

from cornertouchd.monitor.options import PageOptions

READING = ("GET", "HEAD")
ACTING_PATHS = ("/api/save",)
OPEN_PATHS = re.compile(r"/|/targets|/page/.*")
"""The page itself tells nothing; it has the form that asks for the token."""

HOST_HEADER = re.compile(r"(\[[0-9a-f:.]{2,45}\]|[a-z0-9._-]{1,253}?)\.?(:[0-9]{1,5})?")
ORIGIN_HEADER = re.compile(r"https?://([^/?#@\s]{1,300})")
THIS_MACHINE = ("localhost", "127.0.0.1", "[::1]")
ALL_ADDRESSES = ("0.0.0.0", "::")  # noqa: S104  known, not bound to


@dataclass(frozen=True, slots=True)
class Asked:
    """What counts of a request; `headers` by their names in lower case."""

    method: str
    path: str
    headers: Mapping[str, str]
    cookies: Mapping[str, str]

    @property
    def acts(self) -> bool:
        """Whether a browser would send it without asking us whether the page may."""
        return self.method not in READING or "upgrade" in self.headers


@dataclass(frozen=True, slots=True)
class Refusal:
    """A request that is not answered: the status, the reason to count it by, and what to do."""

    status: int
    reason: str
    text: str


class Access:
    """Decides about requests; keeps nothing."""

    def __init__(self, options: PageOptions) -> None:
        self._token = options.token.encode()
        self._cookie = hmac.new(self._token, b"cornertouchd live page", sha256).hexdigest()
        self._serves_all_addresses = options.host in ALL_ADDRESSES
        bound = f"[{options.host}]" if ":" in options.host else options.host
        self._names = {name.lower() for name in (*THIS_MACHINE, bound, *options.names)}
        self.cookie_name = f"cornertouchd-{options.port}"
        """Cookies of one host are shared by all its ports."""

    @property
    def cookie(self) -> str:
        """What a browser that has shown the token carries from then on; it tells no token."""
        return self._cookie

    def refusal(self, asked: Asked) -> Refusal | None:
        """Return why a request is refused, None if it may be answered."""
        host = asked.headers.get("host", "").lower()
        if asked.method not in READING and (asked.method, asked.path in ACTING_PATHS) != (
            "POST",
            True,
        ):
            return Refusal(405, "method", f"{asked.method[:20]} is not for {asked.path[:80]}")
        if not self._is_ours(host):
            return Refusal(
                421,
                "host",
                f"this page is not known as {host[:80]!r}; call it by its address, or add the name "
                "to monitor.names",
            )
        if not _is_same_origin(asked, host):
            return Refusal(
                403,
                "origin",
                f"Origin must be that of this page, http://{host[:80]}; pages of others may "
                "neither watch nor act",
            )
        if not (OPEN_PATHS.fullmatch(asked.path) or self._is_known(asked)):
            return Refusal(401, "token", "a token is needed: that of monitor.token")
        return None

    def knows_token(self, given: str) -> bool:
        """Tell whether this is the token; takes the same time for every wrong one."""
        return hmac.compare_digest(given.encode(), self._token)

    def _is_known(self, asked: Asked) -> bool:
        if not self._token:
            return True
        scheme, _, given = asked.headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self.knows_token(given.strip()):
            return True
        carried = asked.cookies.get(self.cookie_name, "")
        return hmac.compare_digest(carried.encode(), self._cookie.encode())

    def _is_ours(self, host: str) -> bool:
        match = HOST_HEADER.fullmatch(host)
        if match is None:
            return False
        return match[1] in self._names or (self._serves_all_addresses and _is_address(match[1]))


def _is_same_origin(asked: Asked, host: str) -> bool:
    """Tell whether no page of others asks.  Browsers name the page whenever it matters."""
    origin = asked.headers.get("origin")
    if origin is None:
        return not asked.acts
    match = ORIGIN_HEADER.fullmatch(origin.lower())
    return match is not None and match[1] == host


def _is_address(host: str) -> bool:
    """Tell whether a host is an address, which nobody can bind to another one."""
    try:
        ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return False
    return True
