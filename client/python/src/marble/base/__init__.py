"""What everything else stands on: the contract's table and its messages."""
