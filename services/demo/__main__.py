"""`python -m gemelo.services.demo`."""

from gemelo.services.demo.main import main

main()
