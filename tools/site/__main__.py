#!/usr/bin/env python3
"""Build the documentation site into build/site, and check it.

Needs the dependency group `docs` alone, and no network. What the generator warns of is
an error, such as a link or an anchor that leads nowhere. No page lets a browser fetch
anything from another host (`theme/main.html`).

Exit code: 0 if the site is whole, 1 if not.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def built(folder: Path) -> list[str]:
    """Build the site of the `zensical.toml` in a folder.

    Returns:
        What the generator complained of, in its own words; nothing if all is well.
    """
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    done = subprocess.run(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    # Strict is about links; of docstrings it only tells.
    well = not done.returncode and "warning" not in done.stdout.lower()
    return [] if well else done.stdout.splitlines()


def main() -> int:
    """Build and check; return the exit code."""
    wrong = built(ROOT)
    print("\n".join(wrong) or "the site is in build/site: open index.html")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
