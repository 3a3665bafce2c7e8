"""The viewer of recordings: a local web page, and the server that answers it."""
