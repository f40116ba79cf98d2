"""`python -m gemelo.tools.chaos`."""

from gemelo.tools.chaos.main import main

main()
