"""The ports made real: cameras, recordings, network."""
