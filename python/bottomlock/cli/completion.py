"""The command `bottomlock completion`."""

from typing import Annotated, Literal

from cyclopts import Parameter

from bottomlock.cli.console import console


def completion(shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="Which shell.")]) -> None:
    """Print the completion of the command for a shell.

    The shell reads it from a file, or at its start: `source <(bottomlock completion bash)`.
    """
    from bottomlock.cli.app import app  # noqa: PLC0415 - it imports this module by name

    console.file.write(app.generate_completion(prog_name="bottomlock", shell=shell) + "\n")
