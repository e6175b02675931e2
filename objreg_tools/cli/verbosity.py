# SPDX-License-Identifier: Apache-2.0
"""How much a command prints: with -q errors and its result alone, with -v every reason too.

Both are options of `objreg` and of each of its commands. The choice lies in click's context.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import wraps
from typing import Any, TextIO

import click

KEY = f"{__name__}.loudness"
QUIET, USUAL, VERBOSE = "quiet", "usual", "verbose"


def _set(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    """Store the choice; UsageError where both are given."""
    if not wanted:
        return
    if context.meta.get(KEY, parameter.name) != parameter.name:
        raise click.UsageError("expected -q or -v, got both; leave one out", context)
    context.meta[KEY] = parameter.name


def _options() -> list[click.Option]:
    helps = {
        ("-q", "--quiet"): "Print errors and the result alone.",
        ("-v", "--verbose"): "Print every reason, and where an error came from.",
    }
    return [
        click.Option(names, is_flag=True, expose_value=False, callback=_set, help=text) for names, text in helps.items()
    ]


def received_by(command: click.Command) -> click.Command:
    """The command with both options, if it has not got them.

    With -q it prints nothing to standard error; errors are printed when it has ended.
    """
    if not any(parameter.name == QUIET for parameter in command.params):
        command.params.extend(_options())
        if command.callback is not None:
            command.callback = _hushed(command.callback)
    return command


def _hushed(work: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(work)
    def received(*args: Any, **options: Any) -> Any:
        if not is_quiet():
            return work(*args, **options)
        with _nowhere() as nowhere, redirect_stderr(nowhere):
            return work(*args, **options)

    return received


def is_quiet() -> bool:
    """Whether the command line asks for no more than the result."""
    return _asked() == QUIET


def is_verbose() -> bool:
    """Whether the command line asks for every reason."""
    return _asked() == VERBOSE


def _asked() -> str:
    context = click.get_current_context(silent=True)
    return USUAL if context is None else context.meta.get(KEY, USUAL)


@contextmanager
def aside() -> Iterator[None]:
    """Output within is not the result: with -q it is not printed. It decorates functions too."""
    if not is_quiet():
        yield
        return
    with _nowhere() as nowhere, redirect_stdout(nowhere):
        yield


@contextmanager
def _nowhere() -> Iterator[TextIO]:
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        yield nowhere
