"""The client for asyncio: the same calls as marble.Client's, awaited.

    async with marble.aio.Client() as client:
        solution = await client.solve(problem)

To cancel the task that awaits a solve gives it up: the server stops it within 100 ms.
"""

from marble.aio.client import Client, Jobs, solve
from marble.aio.session import Session

__all__ = ["Client", "Jobs", "Session", "solve"]
