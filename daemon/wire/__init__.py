"""Messages on the two sockets: their types, frames, ids and keys."""
