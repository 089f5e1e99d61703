"""Input that nobody means well by: short among the tests, and for an hour with `make soak`."""
