"""Groups of the `thinknav` command, a file each."""
