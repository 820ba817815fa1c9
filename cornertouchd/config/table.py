"""What all tables of settings have in common."""

from pydantic import BaseModel, ConfigDict

Location = tuple[str | int, ...]
"""Where a setting stands in `Settings`: the attributes, names and indices that lead to it."""


class Table(BaseModel):
    """A frozen table of settings that takes neither unknown keys nor values of another type."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
