"""The job file and the files it names: keys, units and defaults are known only here."""
