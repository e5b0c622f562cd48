"""`vid2ev` and `python -m vid2ev`: the command line."""

import codecs
import io
import sys

from vid2ev import commands

PRINTABLE = "vid2ev"  # a way with letters that standard output does not have


def printable(error: UnicodeError) -> tuple[str | bytes, int]:
    """Names of files may be any bytes, and are printed as these; of letters that a terminal lacks numbers are."""
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.backslashreplace_errors(error)


def main() -> None:
    """The command line; ends with SystemExit."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        codecs.register_error(PRINTABLE, printable)
        sys.stdout.reconfigure(errors=PRINTABLE)
    try:
        commands.main()
    except SystemExit as ended:
        if ended.code == commands.INTERRUPTED:
            # (objects of a compiler that were half made then complain as they go, after the last word was said)
            sys.unraisablehook = lambda _: None
        raise


if __name__ == "__main__":
    main()
