# SPDX-License-Identifier: Apache-2.0
"""The files that a command line names: what is read, what is written, and that the two stay apart.

Every option or argument that names a file has a type of this file. By these types `guarded` finds them.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from functools import wraps
from itertools import combinations
from pathlib import Path
from typing import Any

import click

from objreg_mapper.formats.g2o import times_file
from objreg_ros import share
from objreg_ros.detector.labels import ENDS, LABEL_MAP
from objreg_ros.memory.claim import HELPERS
from objreg_ros.whole_file import resolved

STANDARD_OUTPUT = Path("-")
BAG_INDEX = "metadata.yaml"  # beside the files of a rosbag2


class InputPath(click.Path):
    """A file or a folder that is read."""

    def files(self, value: Path | None) -> Iterator[Path]:
        """What is read where the option is ``value``: it, and what belongs to it."""
        if value is not None:
            yield value
            yield from (value.with_name(value.name + helper) for helper in HELPERS if value.name)


class RecordingPath(InputPath):
    """A recording: of a file of a rosbag2 the whole folder is read."""

    def files(self, value: Path | None) -> Iterator[Path]:
        """See `InputPath.files`."""
        yield from super().files(value)
        if value is not None and value.is_file() and (value.parent / BAG_INDEX).is_file():
            yield value.parent


class InputText(click.types.StringParamType):
    """A text that may name a file which is read, or an installed model; in ``NAME=FILE`` behind the sign."""

    def files(self, value: str | None) -> Iterator[Path]:
        """See `InputPath.files`; a text that is a folder's name too is taken for a text."""
        text = (value or "").rpartition("=")[2]
        try:
            if text and not Path(text).expanduser().is_dir():
                yield from InputPath().files(Path(text))
                yield from _of_model(share.model(text))
        except (OSError, ValueError):  # of a text that names no file
            return


class ModelText(InputText):
    """A model, by its path or by its name."""

    def files(self, value: str | None) -> Iterator[Path]:
        """See `InputPath.files`; without a value the model that is taken then."""
        return super().files(value or share.AUTO)


class SettingsPath(InputPath):
    """A parameter file: what its parameters name is read too."""

    def files(self, value: Path | None) -> Iterator[Path]:
        """See `InputPath.files`. ValueError or OSError for a file that holds no parameters."""
        from objreg_tools.cli.settings import read_settings

        yield from super().files(value)
        for text in read_settings(value, ()).changed().values() if value is not None else ():
            if isinstance(text, str):
                yield from InputText().files(text)


class OutputPath(click.Path):
    """A file or a folder that is written."""

    def files(self, value: Path) -> Iterator[Path]:
        """What is written where the option is ``value``: it, and what is put beside it."""
        yield value


class GraphPath(OutputPath):
    """A g2o file: the times of its vertices are written beside it."""

    def files(self, value: Path) -> Iterator[Path]:
        """See `OutputPath.files`."""
        yield from (value, times_file(value)) if value.name else (value,)


INPUTS = (InputPath, InputText)


def guarded(command: click.Command) -> click.Command:
    """The command, which begins only where each of its outputs can be written and is no input and no other output."""
    work = command.callback
    if work is not None and not hasattr(work, "is_guarded"):

        @wraps(work)
        def begin(*args: Any, **given: Any) -> Any:
            require_apart(command, given)
            return work(*args, **given)

        begin.is_guarded = True  # type: ignore[attr-defined]
        command.callback = begin
    return command


def require_apart(command: click.Command, given: Mapping[str, Any]) -> None:
    """ValueError for an output that is an input, lies in one or is another output; OSError for one that cannot be."""
    outputs = [(_named(parameter), output) for parameter, output in _outputs(command, given)]
    inputs = list(_inputs(command, given)) if outputs else []
    for (name, output), (other, again) in combinations(outputs, 2):
        if _is_within(output, again):
            raise ValueError(f"{name}: expected a file of its own, got that of {other}, {output}; choose another")
    for name, output in outputs:
        for other, file in inputs:
            if _is_within(output, file):
                raise ValueError(
                    f"{name}: expected a place apart from all that is read, got {output}, of {other}; choose another"
                )
    for parameter, output in _outputs(command, given):
        if output.is_dir() and not parameter.type.dir_okay:
            raise OSError(f"{_named(parameter)}: expected a file, got the folder {output}; choose another place")
        if not output.is_dir():
            require_writable(_named(parameter), _first_missing(output) if parameter.type.dir_okay else output)


def _first_missing(folder: Path) -> Path:
    """The outermost folder that is made to make a folder; itself where the one above exists."""
    return folder if folder.parent.exists() else _first_missing(folder.parent)


def _outputs(command: click.Command, given: Mapping[str, Any]) -> Iterator[tuple[Any, Path]]:
    """Each parameter that names an output, and the output."""
    for parameter in command.params:
        value = given.get(parameter.name or "")
        if isinstance(parameter.type, OutputPath) and value not in (None, STANDARD_OUTPUT):
            yield from ((parameter, file) for file in parameter.type.files(value))


def _inputs(command: click.Command, given: Mapping[str, Any]) -> Iterator[tuple[str, Path]]:
    for parameter in command.params:
        if isinstance(parameter.type, INPUTS):
            value = given.get(parameter.name or "")
            for one in value if isinstance(value, tuple) else (value,):
                yield from ((_named(parameter), file) for file in parameter.type.files(one))


def _named(parameter: click.Parameter) -> str:
    return parameter.opts[0] if isinstance(parameter, click.Option) else (parameter.name or "").upper()


def _of_model(model: Path) -> Iterator[Path]:
    """A model, its labels and its weights, where these have files of their own."""
    beside = (model.with_name(LABEL_MAP), model.with_name(f"{model.name}.data"), *map(model.with_suffix, ENDS))
    yield from (model, *(file for file in beside if file.is_file()))


def _is_within(output: Path, other: Path) -> bool:
    """Whether two paths lead to one file or folder, or the first into the second; no pipe or device is overwritten."""
    target, place = Path(os.path.realpath(output)), Path(os.path.realpath(other.expanduser()))
    if target.exists() and not target.is_file() and not target.is_dir():
        return False
    if place in (target, *target.parents):
        return True
    return target.exists() and place.exists() and target.samefile(place)  # hard links


def require_writable(option: str, file: Path) -> None:
    """OSError before the work rather than after it, where the ``file`` of an option could not be written."""
    if not file.parent.is_dir():
        raise OSError(f"{option}: expected an existing folder {file.parent}, got none; create it or choose another")
    if not all(os.access(place, os.W_OK) for place in _places(file)):
        raise OSError(f"{option}: expected permission to write {file}, got none; choose another place")
    try:
        _try_to_write(file)
    except OSError as error:
        why = error.strerror or error
        raise OSError(f"{option}: expected a place that takes a file, got at {file}: {why}; choose another") from error


def _places(file: Path) -> list[Path]:
    """What has to be writable: a new file lies in the folder before it takes the place of an old one."""
    if not file.exists():
        return [file.parent]
    return [file, resolved(file).parent] if file.is_file() else [file]


def _try_to_write(file: Path) -> None:
    """OSError where a file can be neither made nor opened for writing, whatever its permissions say; leaves no trace.

    What is no plain file, as a pipe, is not opened: that would wait for its reader.
    """
    if file.exists() and not file.is_file():
        return
    with tempfile.TemporaryFile(dir=resolved(file).parent):
        pass
    if file.exists():
        with file.open("ab"):
            pass
