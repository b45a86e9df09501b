"""The command line: one module per command; `main` runs it and says how it ended.

The commands are imported by `main`, so that Ctrl-C while this takes half a second ends it without a traceback.
"""

import errno
import os
import sys

from ...models.base.errors import PzctlError
from ...models.base.names import shown


def main() -> None:
    """Run the command line; print an error as one sentence on standard error, never as a traceback.

    Exit status: 0 done; 1 no result possible; 2 wrong usage, or a fault that the user can correct; 130 stopped with
    Ctrl-C.
    """
    # The matrices are small: several threads of the linear algebra library would only slow each other down.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from .commands import app

        app()
    except PzctlError as error:
        print(f"pzctl: {shown(str(error), keep=chr(10))}", file=sys.stderr)
        sys.exit(error.exit_status)
    except KeyboardInterrupt:
        print("pzctl: stopped", file=sys.stderr)
        sys.exit(130)
    except Exception as error:
        print(f"pzctl: {_unexpected(error)}", file=sys.stderr)
        sys.exit(1)


_NO_ROOM = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))


def _unexpected(error: Exception) -> str:
    """Return the sentence for an error that only a mistake in pzctl can raise; its traceback goes into a file.

    A full disk, or full standard output, is nobody's mistake and can show itself anywhere.
    """
    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        return shown(f"{error.filename or 'the output'}: cannot be written: {error.strerror}")
    import traceback

    from ..files.paths import home, log_file

    what = shown(f"a mistake in pzctl: {type(error).__name__}: {error}")
    try:
        file = log_file(home(), "unexpected")
        file.write_text(shown(" ".join(sys.argv)) + "\n" + "".join(traceback.format_exception(error)), encoding="utf-8")
    except (OSError, PzctlError):
        return what
    return f"{what}; where it happened stands in {file}, which helps us to mend it"
