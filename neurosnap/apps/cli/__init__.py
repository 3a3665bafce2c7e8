"""The command line: parses, calls, prints. What it prints last with --json is JSON.

Exit codes: 0 all well, 1 failed, 2 wrong usage, 3 finished but something was lost.
"""

# Each module adds its verbs to the app; the order is that of the help.
from neurosnap.apps.cli import config as config
from neurosnap.apps.cli import coordinate as coordinate
from neurosnap.apps.cli import export as export
from neurosnap.apps.cli import keys as keys
from neurosnap.apps.cli import look as look
from neurosnap.apps.cli import measure as measure
from neurosnap.apps.cli import processes as processes
from neurosnap.apps.cli import replay as replay
from neurosnap.apps.cli import run as run
from neurosnap.apps.cli import salvage as salvage
from neurosnap.apps.cli import services as services
from neurosnap.apps.cli import view as view
from neurosnap.apps.cli import watch as watch

from neurosnap.apps.cli.shared import app as app  # isort: skip
