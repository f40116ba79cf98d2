"""`python -m services.chaos`."""

from services.chaos.main import main

main()
