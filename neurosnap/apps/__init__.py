"""What people use: the command line, the page, pictures, figures and exports."""
