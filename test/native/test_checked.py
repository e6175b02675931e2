# SPDX-License-Identifier: Apache-2.0
"""The tests of the kernels' files once more, with kernels that look at every index."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from objreg_ros.native import sources


def files_of_kernels(repository: Path) -> list[str]:
    """The test file of each file with kernels."""
    headers = [path for path in sources.source_files(repository) if "METHODS[]" in path.read_text()]
    mirrored = {
        repository / "test" / header.relative_to(repository).parents[1].relative_to(package) / f"test_{header.stem}.py"
        for header in headers
        for package in [header.relative_to(repository).parts[0]]
    }
    return sorted(str(path.relative_to(repository)) for path in mirrored if path.exists())


@pytest.mark.slow
@pytest.mark.skipif(find_spec("objreg_ros.native.checked") is None, reason="build with OBJREG_CHECKED=1")
def test_no_kernel_looks_beside_an_array_in_its_own_tests(repository: Path) -> None:
    files = files_of_kernels(repository)
    assert len(files) > 25
    words = [sys.executable, "-m", "pytest", "-p", "no:dash", "-p", "no:cacheprovider", "-q", "-x", "-m", "not slow"]
    done = subprocess.run(
        [*words, *files], cwd=repository, env=os.environ | {"OBJREG_CHECKED": "1"}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-3000:]
