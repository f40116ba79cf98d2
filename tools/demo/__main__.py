"""`python -m gemelo.tools.demo`."""

from gemelo.tools.demo.main import main

main()
