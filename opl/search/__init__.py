"""The searches: on arrays, they know no robot."""
