"""A kiosk in a process: user-mode Linux with the stock V4L2 and USB drivers, and systemd.

`machine` finds or builds kernel and root image, `guest` boots them, `python -m system.kiosk` does
both from a shell (with `tests` on the path).
"""
