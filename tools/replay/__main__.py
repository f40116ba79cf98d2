"""`python -m gemelo.tools.replay`."""

from gemelo.tools.replay.main import main

main()
