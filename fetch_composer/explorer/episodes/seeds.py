"""Which seeds are for what, so that no episode of one range is ever met in another."""

TRAINING = range(500_000)
TUNING = range(500_000, 1_000_000)  # For curves, and for choosing settings.
STANDARD = range(1_000_000, 1_001_000)  # Held out: for the standard evaluation alone.
