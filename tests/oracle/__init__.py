"""Plain and slow ways to compute what the package computes fast; tests compare the two."""
