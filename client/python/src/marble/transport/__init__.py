"""Where a client's calls are run: in this process or on servers, behind one interface."""
