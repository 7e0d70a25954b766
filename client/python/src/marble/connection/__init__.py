"""The way to a server: addresses, credentials, one of this process alone, calls on a channel."""
