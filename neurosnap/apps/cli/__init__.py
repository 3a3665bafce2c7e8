"""The command line: parses arguments, calls the library and prints results.

With --format json the last line is JSON. Exit codes: 0 all well, 1 failed, 2 wrong
usage, 3 finished but something was lost.
"""

# Each module adds its verbs to the app; the order is that of the help.
from neurosnap.apps.cli import run as run  # isort: skip
from neurosnap.apps.cli import learn as learn  # isort: skip
from neurosnap.apps.cli import recordings as recordings  # isort: skip
from neurosnap.apps.cli import depth as depth  # isort: skip
from neurosnap.apps.cli import watch as watch  # isort: skip
from neurosnap.apps.cli import serve as serve  # isort: skip
from neurosnap.apps.cli import init as init  # isort: skip
from neurosnap.apps.cli import ros2 as ros2  # isort: skip
from neurosnap.apps.cli.errors_and_signals import app as app  # isort: skip
