"""Clients of a running daemon, for blocking and for asyncio programs."""
