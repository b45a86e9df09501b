"""The lab service: daemon, journal, wire, client, command line."""
