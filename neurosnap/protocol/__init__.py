"""The logic of cells, workers, waves and the coordinator: messages in, messages out."""
