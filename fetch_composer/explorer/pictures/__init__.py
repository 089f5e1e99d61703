"""Films, contact sheets and plots of episodes."""
