"""What is sent and what comes back: Python's values to and from the bytes of the contract's messages."""
