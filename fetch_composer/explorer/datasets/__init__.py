"""Episodes written for the libraries that learn from them."""
