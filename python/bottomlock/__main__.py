"""`python -m bottomlock` is the command `bottomlock`."""

import _thread
import contextlib
import os
import sys
import traceback

from bottomlock.errors import EXIT_INTERRUPTED


def _interrupt_again(ignored: "sys.UnraisableHookArgs") -> None:
    """Sends Ctrl-C again where Python ignored it: in a callback of an import, once in some hundred."""
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        # By a thread, which waits until this function has ended: an interrupt within it is ignored, too.
        _thread.start_new_thread(_thread.interrupt_main, ())
    else:
        sys.__unraisablehook__(ignored)


def main() -> None:
    """Runs the command; Ctrl-C ends it with one line and exit code 130, also while its modules are imported."""
    sys.unraisablehook = _interrupt_again
    try:
        from bottomlock.cli.app import main as run  # noqa: PLC0415 - the import takes long enough to be interrupted

        run()
    except (KeyboardInterrupt, Exception) as error:
        # Libraries turn an interrupt of what they import or build into an error of their own.
        if not isinstance(error, KeyboardInterrupt) and "KeyboardInterrupt" not in traceback.format_exc():
            raise
        sys.stderr.write("bottomlock: interrupted\n")
        with contextlib.suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        # After an interrupt within `exec`, by which dataclasses are made, Python ends by the signal, whatever the code.
        os._exit(EXIT_INTERRUPTED)


if __name__ == "__main__":
    main()
