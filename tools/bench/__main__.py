"""`python -m gemelo.tools.bench`."""

from gemelo.tools.bench.main import main

main()
