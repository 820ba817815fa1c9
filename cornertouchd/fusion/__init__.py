"""All cameras, pure: pairing in time, crossing in space, tracking."""
