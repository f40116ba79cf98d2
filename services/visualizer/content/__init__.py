"""The content of the view: typed updates for entities, without Rerun."""
