"""Checks of the machine: the service, groups, real-time limits, the clock."""

import grp
import os
import pwd
import resource
from collections.abc import Iterator

from cornertouchd.guiding.finding import Finding, doubtful, well, wrong
from cornertouchd.runtime.checks.installation import Installation

SERVICE_USER = "cornertouchd"
NEEDED_GROUPS = ("video", "dialout")
FAST_CLOCKS = {
    "tsc",
    "kvm-clock",
    "arch_sys_counter",
    "hyperv_clocksource_tsc_page",
    "riscv_clocksource",
}
"""Those that a program reads without entering the kernel; others cost a microsecond each time."""


def service_of(installation: Installation) -> Iterator[Finding]:
    """Yield how the service does, if there is one."""
    state = installation.unit_property("ActiveState")
    name = installation.unit
    if not state or installation.unit_property("LoadState") == "not-found":
        yield doubtful(
            "service", f"{name} is not installed", "install the package or the units of systemd/"
        )
        return
    status = installation.unit_property("StatusText")
    # what the unit said last stays when it has been stopped
    if state == "failed" or ("does not start" in status and state != "inactive"):
        yield wrong("service", f"{name} fails: {status or state}", f"journalctl -u {name}")
    elif state == "active":
        make = doubtful if "degraded" in status or "refused" in status else None
        text = f"{name} runs: {status}"
        yield make("service", text, f"journalctl -u {name}") if make else well("service", text)
    else:
        yield doubtful("service", f"{name} is {state}", f"systemctl start {name}")
    restarts = installation.unit_property("NRestarts")
    if restarts.isdecimal() and int(restarts) > 0:
        yield doubtful(
            "service",
            f"systemd has restarted it {restarts} times",
            f"look for what comes before in journalctl -u {name}",
        )
    if installation.unit_property("UnitFileState") == "disabled":
        yield doubtful("service", f"{name} does not start at boot", f"systemctl enable {name}")


def groups_of(_: Installation) -> Iterator[Finding]:
    """Yield whether the user of the service, else this one, may open the devices."""
    try:
        user = pwd.getpwnam(SERVICE_USER)
    except KeyError:
        user = pwd.getpwuid(os.getuid())
    if user.pw_uid == 0:
        yield doubtful(
            "permissions",
            f"there is no user {SERVICE_USER}, and this is root",
            "install the package, or run systemd-sysusers with systemd/cornertouchd.sysusers",
        )
        return
    groups = {grp.getgrgid(gid).gr_name for gid in os.getgrouplist(user.pw_name, user.pw_gid)}
    lacking = [group for group in NEEDED_GROUPS if group not in groups]
    if lacking:
        yield wrong(
            "permissions",
            f"user {user.pw_name} is not in group {' nor '.join(lacking)}",
            f"usermod -aG {','.join(lacking)} {user.pw_name}, then log in anew or restart the "
            "service",
        )
    else:
        yield well("permissions", f"user {user.pw_name} is in groups {', '.join(NEEDED_GROUPS)}")


def real_time_of(installation: Installation) -> Iterator[Finding]:
    """Yield whether the priority that is asked for will be granted."""
    wanted = installation.settings.runtime.realtime_priority
    if not wanted:
        yield well("real time", "no priority is asked for (runtime.realtime_priority = 0)")
        return
    of_unit = installation.unit_property("LimitRTPRIO")
    limit = int(of_unit) if of_unit.isdecimal() else resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    if limit >= wanted or limit == resource.RLIM_INFINITY:
        yield well("real time", f"priority {wanted} is granted")
    else:
        yield doubtful(
            "real time",
            f"priority {wanted} is asked for, up to {limit} is granted",
            f"set LimitRTPRIO={wanted} in the service; as a user, rtprio in /etc/security/limits.d",
        )


def clock_of(installation: Installation) -> Iterator[Finding]:
    """Yield whether time is cheap to read, and whether there is a better clock."""
    directory = installation.sysfs / "devices/system/clocksource/clocksource0"
    try:
        current = (directory / "current_clocksource").read_text().strip()
        available = (directory / "available_clocksource").read_text().split()
    except OSError:
        yield doubtful("clock", "the kernel does not tell its clock source", "mount sysfs")
        return
    if current in FAST_CLOCKS:
        yield well("clock", f"clock source {current}")
        return
    better = [one for one in available if one in FAST_CLOCKS]
    remedy = f"boot with clocksource={better[0]}" if better else "look for why in the kernel's log"
    yield doubtful("clock", f"clock source {current} is slow to read", remedy)
