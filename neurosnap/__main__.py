"""``python -m neurosnap`` and the ``neurosnap`` command.

Kept free of imports: multiprocessing imports a script's main module again in every
child, and a cell must not pay for the command line.
"""


def main() -> None:
    """Run the command line."""
    import neurosnap

    if not hasattr(neurosnap, "__all__"):
        # PyPI's project of the same name came later and put its own file in the place
        # of ours, and with it the warning that ours gives.
        import sys

        from neurosnap.system.distribution import namesake

        sys.exit(f"error: {namesake()}")

    from neurosnap.system.signals import quit_at_once

    quit_at_once()  # before the imports: they take the longest of the start
    from neurosnap.apps.cli import app

    _escape_where_needed()
    app()


def _escape_where_needed() -> None:
    r"""Let standard output and error take any letter, whatever they encode in.

    An arrow becomes ``\u2192`` where there is none.
    """
    import io
    import sys

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    main()
