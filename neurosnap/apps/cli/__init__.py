"""The command line: parses, calls, prints. What it prints last with --json is JSON.

Exit codes: 0 all well, 1 failed, 2 wrong usage, 3 finished but something was lost.
"""

# Each module adds its verbs to the app; the order is that of the help.
from neurosnap.apps.cli import run as run  # isort: skip
from neurosnap.apps.cli import learn as learn  # isort: skip
from neurosnap.apps.cli import health as health  # isort: skip
from neurosnap.apps.cli import replay as replay  # isort: skip
from neurosnap.apps.cli import measure as measure  # isort: skip
from neurosnap.apps.cli import look as look  # isort: skip
from neurosnap.apps.cli import salvage as salvage  # isort: skip
from neurosnap.apps.cli import export as export  # isort: skip
from neurosnap.apps.cli import processes as processes  # isort: skip
from neurosnap.apps.cli import coordinate as coordinate  # isort: skip
from neurosnap.apps.cli import services as services  # isort: skip
from neurosnap.apps.cli import watch as watch  # isort: skip
from neurosnap.apps.cli import view as view  # isort: skip
from neurosnap.apps.cli import topics as topics  # isort: skip
from neurosnap.apps.cli import keys as keys  # isort: skip
from neurosnap.apps.cli import config as config  # isort: skip
from neurosnap.apps.cli.shared import app as app  # isort: skip
