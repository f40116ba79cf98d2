"""`python -m services.bench`."""

from services.bench.main import main

main()
