"""The service: jobs over HTTP."""
