"""Proof of the file itself: written programs are read back, played, recognised and replayed."""
