"""Growing sensors: which, when, and what they weigh at birth."""
