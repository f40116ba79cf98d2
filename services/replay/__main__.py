"""`python -m services.replay`."""

from services.replay.main import main

main()
