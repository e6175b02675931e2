# SPDX-License-Identifier: Apache-2.0
"""The executable `objreg`, and `python -m objreg_tools`: the process is the command's, from its first line to its last.

Until the command is imported, and when it has ended, Ctrl-C ends the process as it does any other, without a
traceback.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Run the command line; it ends with `SystemExit`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as behind nohup
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from objreg_ros.terminal import protect_terminal

    protect_terminal()
    try:
        from objreg_tools.cli import INTERRUPTED
        from objreg_tools.cli import main as run
    except ModuleNotFoundError as absent:
        if absent.name != "click":
            raise
        sys.exit("objreg: expected click, got none; pip install 'objreg_ros[tools]' brings it")

    try:
        run()
    except SystemExit as ended:
        if ended.code != INTERRUPTED:
            raise
        with suppress(OSError, ValueError):  # nobody may be there to read it
            sys.stdout.flush()
        os._exit(INTERRUPTED)  # at once: Open3D, interrupted as it is loaded, would end the process with 1


if __name__ == "__main__":
    main()
