"""The live page beside the press: a client of the daemon that serves one local web page, in a process of its own."""
