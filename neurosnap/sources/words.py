"""Words that say on, off or unknown."""

ON = ("on", "true", "1", "yes", "open", "opened", "detected", "home", "online")
OFF = ("off", "false", "0", "no", "closed", "clear", "not_home", "offline")
UNKNOWN = ("", "none", "null", "unknown", "unavailable")
"""Words that say that nothing is known, for every sensor; an empty payload is one."""
