"""Who may connect, who may do what, and who holds the instrument."""
