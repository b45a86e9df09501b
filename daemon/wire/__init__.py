"""The messages on the two sockets: types, frames, ids and keys."""
