# SPDX-License-Identifier: Apache-2.0
"""What the command lines of the benchmarks have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click
from click.core import ParameterSource


def given(context: click.Context, name: str) -> bool:
    """Whether an option was named on the command line, whatever its value."""
    return context.get_parameter_source(name) not in (None, ParameterSource.DEFAULT)


def quick_values(context: click.Context, quick: bool, values: Mapping[str, Any]) -> dict[str, Any]:
    """What ``--quick`` changes: of ``values`` those whose option was not given; nothing without ``quick``."""
    return {name: value for name, value in values.items() if quick and not given(context, name)}
