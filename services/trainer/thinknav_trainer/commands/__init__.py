"""Groups of commands of `thinknav`, one file a group."""
