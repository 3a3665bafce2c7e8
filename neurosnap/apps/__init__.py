"""What people use: the command line, the page, pictures and exports."""
