"""The settings of the process itself."""

from pydantic import Field

from cornertouchd.config.table import Table


class RuntimeSettings(Table):
    """How the daemon runs on its machine."""

    realtime_priority: int = Field(
        10,
        ge=0,
        le=20,
        description="Real-time priority (SCHED_FIFO) of the threads that take pictures and follow "
        "touches, so that a busy browser does not delay them. The system grants it by LimitRTPRIO "
        "of the service; without that the daemon says so once and runs as any other program. "
        "0: do not ask.",
    )
