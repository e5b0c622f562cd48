"""`vid2ev` and `python -m vid2ev`: the command line."""

from vid2ev.commands import main

if __name__ == "__main__":
    main()
