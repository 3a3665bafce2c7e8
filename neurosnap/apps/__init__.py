"""User-facing programs: the command line, the page, pictures and exports."""
