"""Sets of changes, their fits to a pair, and the search among them."""
