"""What every motion has to cross, at all of its postures, and where it cannot."""
