"""Real-time priority for the threads that pictures and touches wait for."""

import logging
import os
from collections.abc import Iterable

_log = logging.getLogger("cornertouchd")


def prioritise(native_ids: Iterable[int], priority: int) -> bool:
    """Schedule threads of this process first come, first served at a priority from 1 to 99.

    0 takes it from them again.  What they start does not inherit it.  Says once if the system
    refuses, which costs nothing but punctuality on a busy machine; tells whether it was granted.
    """
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK if priority else os.SCHED_OTHER
    try:
        for native_id in native_ids:
            if priority or os.sched_getscheduler(native_id) != os.SCHED_OTHER:
                os.sched_setscheduler(native_id, policy, os.sched_param(priority))
    except ProcessLookupError:
        return False  # a thread that has ended needs none
    except OSError as error:
        _log.info(
            "real-time priority %d is not granted (%s), so a busy machine may delay touches; "
            "set LimitRTPRIO=%d in the service, or runtime.realtime_priority = 0",
            priority,
            error.strerror,
            priority,
        )
        return False
    return True
