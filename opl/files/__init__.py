"""Files that people write, and where the data that comes with opl lies."""
