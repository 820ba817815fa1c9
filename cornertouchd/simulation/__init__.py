"""A simulated rig that fills the same ports as real devices."""
