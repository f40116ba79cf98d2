"""The operator's page: the arm in a browser, to see, to lead, to teach and to stop."""
