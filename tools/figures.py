#!/usr/bin/env python3
"""Make the paper's figures from a checkout: ``neurosnap figures``."""

import sys
from pathlib import Path

# Run as a file, the folder of this file is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from neurosnap.apps.cli import app

if __name__ == "__main__":
    app(["figures", *sys.argv[1:]])
