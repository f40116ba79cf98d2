"""`python -m gemelo.services.replay`."""

from gemelo.services.replay.main import main

main()
