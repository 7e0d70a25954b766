"""Problems, as the solver takes them, as planners state them, in files; and their solutions."""
