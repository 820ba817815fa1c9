"""What the user can mend."""


class ReportedError(Exception):
    """An error whose text is for the user: it names the thing, the value and the remedy."""
