"""Jobs worked on in processes of their own, with limits: batches, and whoever else has many."""
