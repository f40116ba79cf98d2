"""Actions: long-running goals with feedback, a result and a cancel."""
