"""Lead a person through a calibration: what to do next, and whether it was done well."""
