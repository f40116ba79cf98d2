"""A stand-in for LeRobot, which brings torch: the names that its plug-ins import, in the places where 0.4.4 and 0.6.1
have them, with their signatures, abstract methods and side effects. Nothing else of it is here."""
