"""Sources of observations: Gymnasium, CSV files, and live sensors."""
