"""How probable each explanation is, and what could stay hidden."""
