# SPDX-License-Identifier: Apache-2.0
"""The command `objreg`: one file a subcommand, imported only when it is called.

``cli/commands/<name>.py`` holds the command ``<name>`` (dashes become underscores, and ``try`` is
``try_.py``) as the function ``command``; ``cli/commands/stores/<name>.py`` one that works on a store.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from objreg_ros.native import UnbuiltError
from objreg_ros.whole_file import unwritten
from objreg_tools.cli import verbosity

# The text of `objreg --help`, without importing a command. A name without its file is not shown.
SUMMARIES = {
    "try": "From a recording to a page in one command.",
    "demo": "Run a recording through the live graph and show what came out.",
    "inspect": "Show what is in a recording and what the graph would use of it, or what a store holds.",
    "offline": "Run a recording through the three stages, without ROS.",
    "pair": "Register two frames of a recording, and show what each step saw.",
    "batch": "Run many recordings, over the cores of this machine or a cluster.",
    "sweep": "Run recordings with every combination of parameter values, and compare.",
    "replay": "Publish a recording into the live graph.",
    "watch": "Show a running graph on a page of this machine.",
    "metrics": "Serve the counters of a running graph for Prometheus.",
    "convert": "Write any recording as rosbag2.",
    "veto": "Withdraw closures of a store that are wrong, or undo that.",
    "accept": "Write a closure of two keyframes of a store that a person knows to be right.",
    "merge": "Merge stores of several robots or days into one, tied together.",
    "export": "Write the objects of a store as PLY and JSON, and its map.",
    "where": "Show where objects are on the map of a store.",
    "export-labels": "Label the pictures of a recording with its objects, to train a detector on.",
    "simulate": "Make a recording with exact ground truth.",
    "fetch-model": "Get a detector model.",
    "report": "Draw pictures and tables of a run.",
    "params": "Show every parameter, or write the files that are made from them.",
    "policy": "Show a policy of SROS 2: who may write, read and call what.",
    "doctor": "Check whether a run can work here, and what is missing.",
}
FOLDER = Path(__file__).parent / "commands"
PACKAGES = "", "stores"  # of commands, below that folder
NAME = "objreg"
BROKEN, NOTHING, INTERRUPTED, UNHEARD, TERMINATED = 1, 3, 130, 141, 143  # nothing: what was read gave no frame
BROKEN_INPUT = OSError, ValueError, UnbuiltError  # or kernels that are not built: one line, no traceback
AGAIN_S = 0.05  # after which an interrupt that was swallowed comes again


class LazyGroup(click.Group):
    """A group that imports a command when it is called, so that `--help` is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands whose files are there."""
        return [name for name in SUMMARIES if _module(name)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, imported; None if there is none of this name."""
        if cmd_name not in self.list_commands(ctx):
            return None
        command: click.Command = import_module(_module(cmd_name)).command
        from objreg_tools.cli import paths

        return paths.guarded(verbosity.received_by(command))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The completions of a tab: the commands without their import, and the options."""
        names = [name for name in self.list_commands(ctx) if name.startswith(incomplete)]
        items = [CompletionItem(name, help=SUMMARIES[name]) for name in names]
        return items + click.Command.shell_complete(self, ctx, incomplete)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of `--help`, from the summaries."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, SUMMARIES[name]) for name in self.list_commands(ctx)])

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; with -v a broken input shows its traceback before its message.

        The command ends when the reader of its output has left, as `head` does.
        """
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            _leave_output()
            ctx.exit(UNHEARD)
        except BROKEN_INPUT as error:
            if verbosity.is_verbose():
                traceback.print_exception(error)
            raise


def _module(name: str) -> str:
    """The module of a command, empty where there is none; ``try`` is a word of Python's own."""
    stem = name.replace("-", "_") + ("_" if iskeyword(name) else "")
    packages = (package for package in PACKAGES if (FOLDER / package / f"{stem}.py").exists())
    return next((".".join(filter(None, (f"{__name__}.commands", package, stem))) for package in packages), "")


def _print_version(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from objreg_tools.report.run.about import version

        click.echo(f"{NAME} {version()}")
        context.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_print_version, help="Show the version."
)
def group() -> None:
    """Object-level loop closure: recordings, offline runs and the live graph.

    `objreg COMMAND --help` describes a command. -q and -v go before it or behind it.
    """


verbosity.received_by(group)


def main(*arguments: Any) -> None:
    """The executable. A broken input is one line on stderr and exit 1, as are kernels that are not built.

    Anything else is a bug and has a traceback. A run of which no frame got through ends with 3, as does the inspection
    of what the graph cannot run on.

    SIGINT, SIGTERM and a reader of the output who has left end what was begun, with the usual status.
    """
    try:
        with _ended_by_signals():
            code = group.main(args=list(arguments) or None, prog_name=NAME, standalone_mode=False)
            sys.stdout.flush()
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except BrokenPipeError:
        _leave_output()
        sys.exit(UNHEARD)
    except BROKEN_INPUT as error:
        click.echo(f"objreg: {' '.join(str(_named(error)).split())}", err=True)
        sys.exit(BROKEN)
    except (KeyboardInterrupt, click.Abort):
        sys.exit(INTERRUPTED)


def _named(error: Exception) -> Exception:
    """The error; where a disk is full and the error names no file, it is that of standard output: all others do."""
    if isinstance(error, OSError) and error.errno == errno.ENOSPC and error.filename is None:
        _leave_output()
        return unwritten("standard output", error)
    return error


def _leave_output() -> None:
    """Close an output that takes nothing, so that Python does not try it again at its end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Within the block SIGTERM leaves through every `with` and `finally`, as Ctrl-C does.

    Libraries receive them too: ROS shuts down, an import fails. Their messages, even in place of the exit, are no
    bug. Where one swallows the interrupt, it comes again.
    """
    received: list[int] = []

    def end(number: int, _: object) -> None:
        received.append(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        sys.exit(TERMINATED)

    with _received(end), _never_swallowed():
        try:
            yield
        except BaseException:  # a library may leave with a status of its own
            if not received:
                raise
        if received:  # also where the command came to its end, with an import less
            sys.exit(INTERRUPTED if received[0] == signal.SIGINT else TERMINATED)


@contextmanager
def _received(end: Any) -> Iterator[None]:
    """Both signals call ``end`` within the block; an interrupt that is ignored, as behind nohup, stays so."""
    before = {signal.SIGTERM: signal.signal(signal.SIGTERM, end)}
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _never_swallowed() -> Iterator[None]:
    """Within the block an interrupt that cannot be raised shows no traceback: it comes again shortly after."""
    before = sys.unraisablehook

    def come_again(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            again = threading.Timer(AGAIN_S, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT))
            again.daemon = True
            again.start()
        else:
            before(unraisable)

    sys.unraisablehook = come_again
    try:
        yield
    finally:
        sys.unraisablehook = before
