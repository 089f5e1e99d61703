"""Policies that the user brings: ONNX networks, zips of Stable-Baselines3, and code."""
