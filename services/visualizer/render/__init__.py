"""The output to Rerun: layout, columns, viewer and recording."""
