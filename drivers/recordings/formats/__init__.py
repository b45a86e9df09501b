"""Recording formats, one file each."""
