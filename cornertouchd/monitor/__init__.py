"""The live page: a process of its own that serves browsers what the daemon tells it."""
