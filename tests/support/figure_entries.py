"""A small entry of the table of learning errors."""

from neurosnap.apps.figures.experiments.learning_error import LearningEntry

ENTRY = LearningEntry(
    setting="path",
    threshold=1 / 8000,
    decay=None,
    truth="contained",
    equivalences=False,
    runs=2,
    steps=300,
    seed=5,
)
