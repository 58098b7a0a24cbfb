"""The robot and what stands around it."""
