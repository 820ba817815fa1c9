"""Simulated USB cameras that the kernel's own drivers run: USB Video Class over USB/IP.

`rig.UvcRig` plugs them in; one process serves them all (`server`).  The kernel needs
`vhci-hcd` and `uvcvideo`, the process needs root.
"""
