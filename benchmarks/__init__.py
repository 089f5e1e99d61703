"""How fast the environments are, beside bare MuJoCo and beside their peers."""
