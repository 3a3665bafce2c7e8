"""The viewer of recordings: a local web page and its server."""
