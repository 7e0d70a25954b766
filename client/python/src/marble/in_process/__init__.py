"""The solver in this process, marble._core: its loading, its errors and its end."""
