"""`python -m gemelo.services.chaos`."""

from gemelo.services.chaos.main import main

main()
