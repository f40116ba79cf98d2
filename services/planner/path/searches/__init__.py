"""The searches of `gemelo.schemas.planners`, each a module with `corners` as `services.planner.path.search` asks it."""
