"""What the verbs share: errors in the words they came in."""

import pytest
import typer

from neurosnap.apps.cli.shared import errors
from neurosnap.errors import NeurosnapError


@pytest.mark.parametrize(
    "text",
    [r"\[/b]", "[/red]", "[b]bold[/b]", "[link=file:/x]", "\\", "a\\[x]\\", "[]"],
)
def test_an_error_is_told_in_its_own_words(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as ended, errors():
        raise NeurosnapError(text)
    assert ended.value.exit_code == 1
    assert capsys.readouterr().err == f"error: {text}\n"
