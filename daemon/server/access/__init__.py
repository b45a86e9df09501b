"""Access: which clients may connect, what each may do, and who has leased the instrument."""
