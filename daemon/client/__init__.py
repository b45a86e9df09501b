"""Client side: talk to a running daemon, from blocking and from asyncio programs."""
