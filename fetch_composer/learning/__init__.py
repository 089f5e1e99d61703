"""Learns the tasks from nothing: TD3 with hindsight relabelling, in JAX, on the native batch.

Read it in this order: `settings` (every number), `networks`, `symmetry`, `replay`, `td3`, `relay`,
`exploration`, `trainer` (what one iteration does) and `train` (a whole run).
`python -m fetch_composer.learning` runs it.
"""
