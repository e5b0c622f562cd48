"""`vid2ev` and `python -m vid2ev`: the command line."""

import io
import sys

from vid2ev import commands


def main() -> None:
    """The command line; ends with SystemExit."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="surrogateescape")  # (names of files may be any bytes, and are printed as these)
    try:
        commands.main()
    except SystemExit as ended:
        if ended.code == commands.INTERRUPTED:
            # (objects of a compiler that were half made then complain as they go, after the last word was said)
            sys.unraisablehook = lambda _: None
        raise


if __name__ == "__main__":
    main()
