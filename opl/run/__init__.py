"""A run of a job: its stages, what each of them makes, and what is reported and delivered of it."""
