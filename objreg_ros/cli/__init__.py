# SPDX-License-Identifier: Apache-2.0
"""The command `objreg`: one file a subcommand, imported only when it is called.

``cli/<name>.py`` holds the command ``<name>`` (dashes become underscores) as the function ``command``.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import click

# What `objreg --help` says without importing a command. A name without its file is not shown.
SUMMARIES = {
    "demo": "Run a recording through the live graph and show what came out.",
    "inspect": "Say what is in a recording and what the graph would use of it, or what a store remembers.",
    "offline": "Run a recording through the three rooms without ROS.",
    "replay": "Publish a recording into the live graph.",
    "convert": "Write any recording as rosbag2.",
    "export": "Write the objects of a store as PLY and JSON.",
    "simulate": "Make a recording with exact ground truth.",
    "fetch-model": "Get a detector model.",
    "report": "Draw pictures and tables of a run.",
    "params": "Show every parameter, or write the files that are made from them.",
}
FOLDER = Path(__file__).parent
BROKEN, NOTHING, INTERRUPTED, TERMINATED = 1, 3, 130, 143  # nothing: what was read gave no frame, or cannot
FIRST_TIME = "the first time compiles for a minute"


class LazyGroup(click.Group):
    """A group that imports a command when it is called, so that `--help` is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands whose files are there."""
        return [name for name in SUMMARIES if (FOLDER / f"{_module(name)}.py").exists()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, imported; None if there is none of this name."""
        if cmd_name not in self.list_commands(ctx):
            return None
        return import_module(f"objreg_ros.cli.{_module(cmd_name)}").command  # type: ignore[no-any-return]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of `--help`, from the summaries."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, SUMMARIES[name]) for name in self.list_commands(ctx)])


def _module(name: str) -> str:
    return name.replace("-", "_")


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
def group() -> None:
    """Object-level loop closure: recordings, offline runs and the live graph."""


def main(*arguments: Any) -> None:
    """The executable. A broken input is one line on stderr and exit 1; anything else is a bug and shows itself.

    A run of which no frame got through ends with 3, as does the inspection of what the graph cannot run on.

    SIGINT and SIGTERM end what was begun, with the usual status.
    """
    try:
        with _ended_by_sigterm():
            code = group.main(args=list(arguments) or None, standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (OSError, ValueError) as error:
        click.echo(f"objreg: {' '.join(str(error).split())}", err=True)
        sys.exit(BROKEN)
    except (KeyboardInterrupt, click.Abort):
        sys.exit(INTERRUPTED)


@contextmanager
def _ended_by_sigterm() -> Iterator[None]:
    """Within the block SIGTERM leaves through every `with` and `finally`, as Ctrl-C does.

    ROS hears it too and shuts down: what it says of that, even in place of the exit, is no bug.
    """
    told: list[int] = []

    def end(number: int, _: object) -> None:
        told.append(number)
        sys.exit(TERMINATED)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    except (Exception, KeyboardInterrupt):
        if not told:
            raise
        sys.exit(TERMINATED)
    finally:
        signal.signal(signal.SIGTERM, before)
