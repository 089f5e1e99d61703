"""What is timed: one process for each, which need not have `fetch_composer` installed."""
