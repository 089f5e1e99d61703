"""Episodes of a policy: how they are run, and run again."""
