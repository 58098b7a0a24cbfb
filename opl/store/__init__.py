"""What was asked for and what became of it: jobs, their states and their files, on the disk."""
