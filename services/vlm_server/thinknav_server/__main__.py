"""`python -m thinknav_server` is `thinknav-server`."""

from thinknav_server.cli import main

main()
