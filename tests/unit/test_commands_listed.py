"""`cornertouchd --help` names each command and says what the command says of itself."""

import pytest
from click.testing import CliRunner

from cornertouchd.cli import COMMANDS, main


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_the_list_says_what_the_command_says(name: str) -> None:
    told = CliRunner().invoke(main, [name, "--help"])
    assert told.exit_code == 0
    assert told.output.splitlines()[2].strip() == COMMANDS[name]
    assert COMMANDS[name] in CliRunner().invoke(main, ["--help"]).output


def test_an_unknown_command_is_wrong_usage() -> None:
    refused = CliRunner().invoke(main, ["dmo"])
    assert refused.exit_code == 2
    assert "No such command 'dmo'" in refused.output
