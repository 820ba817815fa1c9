"""What the daemon answers at its socket."""

from collections.abc import Callable

from cornertouchd.ports import Clock
from cornertouchd.runtime.asking import Answer, document
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.displays import Displays
from cornertouchd.runtime.health import HealthWatch, as_json
from cornertouchd.runtime.hello import hello
from cornertouchd.runtime.kept_stream import pictures_of
from cornertouchd.runtime.log_tail import LogTail
from cornertouchd.runtime.monitor_feed import MonitorFeed


def answers_of(
    daemon: Daemon,
    health: HealthWatch,
    log: LogTail,
    configuration: str,
    displays: Callable[[], Displays],
    clock: Clock,
) -> dict[str, Answer]:
    """Return every answer by the name that it is asked for by.  See `hello` for the others."""
    return {
        "status": document(lambda: as_json(health.tell())),
        "hello": document(lambda: hello(daemon, configuration, displays)),
        "log": document(log.as_json),
        "pictures": pictures_of(daemon, clock),
        "live": MonitorFeed(daemon, clock),
    }
