"""`python -m gemelo.services.bench`."""

from gemelo.services.bench.main import main

main()
